"""What `omninav --help` and `omninav COMMAND --help` print: the texts in `omninav.conf`."""

import re
from collections.abc import Sequence
from importlib.resources import files

from .config_groups import CONF, group_files

FLAGS = ("-h", "--help")


def asks_for_help(words: Sequence[str]) -> bool:
    """Whether a command line asks what may be typed."""
    return words[:1] == ["help"] or any(word in FLAGS for word in words)


def help_text(words: Sequence[str]) -> str:
    """The text of the command that a command line names, of `omninav` where it names none."""
    named = [word for word in words if word not in (*FLAGS, "help")]
    for name in ("_".join(named[:2]), *named[:1]):
        file = files(CONF).joinpath("help", f"{name}.txt")
        if name.isidentifier() and file.is_file():
            return re.sub(r"\{group:(\w+)\}", lambda found: _options(found[1]), file.read_text(encoding="utf-8"))
    return files(CONF).joinpath("help.txt").read_text(encoding="utf-8")


def _options(group: str) -> str:
    return ", ".join(file.name.removesuffix(".yaml") for file in group_files(group))
