"""Texts of `omninav --help` and `omninav COMMAND --help`: a section of `help.txt`, or a tool's arguments."""

import re
from collections.abc import Sequence
from importlib.resources import files

from .config_groups import CONF, group_options
from .tools import tool_help, tools

FLAGS = ("-h", "--help")
SECTION = re.compile(r"^=== (\w+)\n(.*?\n)(?=\n===|\Z)", re.MULTILINE | re.DOTALL)
"""A command's name in `help.txt`, and its text."""


def asks_for_help(words: Sequence[str]) -> bool:
    """Tells whether a command line asks what may be typed."""
    return words[:1] == ["help"] or any(word in FLAGS for word in words)


def help_text(words: Sequence[str]) -> str:
    """The text of the command or tool that a command line names, of `omninav` where it names none."""
    named = [word for word in words if word not in (*FLAGS, "help")]
    texts = dict(SECTION.findall(files(CONF).joinpath("help.txt").read_text(encoding="utf-8")))
    found: list[str] = []
    tool = " ".join(named[:2])
    of_group = [one for one in tools() if named and one.startswith(f"{named[0]} ")]
    if tool not in of_group and named and named[0] in texts:
        found.append(re.sub(r"\{group:(\w+)\}", lambda match: ", ".join(group_options(match[1])), texts[named[0]]))
    found += map(tool_help, [tool] if tool in of_group else of_group)
    return "\n".join(found) or texts["omninav"]
