"""Texts of `omninav --help` and `omninav COMMAND --help`: those in `omninav.conf`, and of tools."""

import re
from collections.abc import Sequence
from importlib.resources import files

from .config_groups import CONF, group_options
from .tools import tool_help, tools

FLAGS = ("-h", "--help")


def asks_for_help(words: Sequence[str]) -> bool:
    """Whether a command line asks what may be typed."""
    return words[:1] == ["help"] or any(word in FLAGS for word in words)


def help_text(words: Sequence[str]) -> str:
    """The text of the command or tool that a command line names, of `omninav` where it names none."""
    named = [word for word in words if word not in (*FLAGS, "help")]
    texts = files(CONF).joinpath("help")
    found: list[str] = []
    tool = " ".join(named[:2])
    of_group = [one for one in tools() if named and one.startswith(f"{named[0]} ")]
    if tool not in of_group and named and f"{named[0]}.txt" in {file.name for file in texts.iterdir()}:
        text = texts.joinpath(f"{named[0]}.txt").read_text(encoding="utf-8")
        found.append(re.sub(r"\{group:(\w+)\}", lambda match: _options(match[1]), text))
    found += map(tool_help, [tool] if tool in of_group else of_group)
    if found:
        return "\n".join(found)
    return files(CONF).joinpath("help.txt").read_text(encoding="utf-8")


def _options(group: str) -> str:
    return ", ".join(group_options(group))
