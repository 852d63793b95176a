"""Texts of `omninav --help` and `omninav COMMAND --help`: those in `omninav.conf`, and a tool's file."""

import re
from collections.abc import Sequence
from importlib.resources import files

from .config_groups import CONF, group_options, tools

FLAGS = ("-h", "--help")
BLOCKS = ("defaults", "variant", "inputs", "nodes", "wires", "artifacts", "saves")
"""Keys at the top of a variant's file that are no settings."""


def asks_for_help(words: Sequence[str]) -> bool:
    """Whether a command line asks what may be typed."""
    return words[:1] == ["help"] or any(word in FLAGS for word in words)


def help_text(words: Sequence[str]) -> str:
    """The text of the command or tool that a command line names, of `omninav` where it names none."""
    named = [word for word in words if word not in (*FLAGS, "help")]
    texts = files(CONF).joinpath("help")
    found: list[str] = []
    tool = " ".join(named[:2])
    of_group = [one for one in tools() if named and one.split()[0] == named[0]]
    if tool not in of_group and named and f"{named[0]}.txt" in {file.name for file in texts.iterdir()}:
        text = texts.joinpath(f"{named[0]}.txt").read_text(encoding="utf-8")
        found.append(re.sub(r"\{group:(\w+)\}", lambda match: _options(match[1]), text))
    found += map(_of_tool, [tool] if tool in of_group else of_group)
    if found:
        return "\n".join(found)
    return files(CONF).joinpath("help.txt").read_text(encoding="utf-8")


def _options(group: str) -> str:
    return ", ".join(group_options(group))


def _of_tool(named: str) -> str:
    """The comment at the head of a tool's file, its example, its inputs, and its settings with their comments."""
    import yaml

    text = files(CONF).joinpath(f"variant/{named.replace(' ', '_')}.yaml").read_text(encoding="utf-8")
    content, tool = yaml.safe_load(text), f"omninav {named}"
    comment = next(line for line in text.splitlines() if line.startswith("# ") and "@package" not in line)
    what, _, example = comment[2:].partition("  omninav ")
    rows = []
    for name, given in content["inputs"].items():
        required = isinstance(given, dict) and given.get("required", False)
        meaning = given["meaning"] if isinstance(given, dict) else given
        rows.append((f"{name}=…", meaning + (" (required)" if required else "")))
    for name, value in content.items():
        if name not in BLOCKS and name not in content["inputs"]:
            said = re.search(rf"^{name}:[^#\n]*# *(.*)$", text, re.MULTILINE)
            rows.append((f"{name}={'…' if value is None else value}", said[1] if said else ""))
    _, _, typed = example.partition(" ")
    lines = [f"{tool}     {what}", "", f"  {tool} {typed}", ""]
    return "\n".join([*lines, *(f"  {name:16} {meaning}" for name, meaning in rows), ""])
