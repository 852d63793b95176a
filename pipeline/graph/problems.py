"""Problems of a configuration: where, what, and what to type. All of them at once."""

import difflib
import errno
import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

MAX_LISTED = 20
"""Names that are listed behind the one that was probably meant."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    `where`: the config path (`nodes.smoothing.gain`) or file; `what`: what was found and what was expected;
    `hint`: what to type or where to look, '' where there is nothing useful.
    """

    where: str
    what: str
    hint: str = ""

    def __str__(self) -> str:
        return one_line(f"{self.where}: {self.what}") + (f"\n    {one_line(self.hint)}" if self.hint else "")


class ProblemsFound(Exception):
    """A configuration that cannot be built or run, with everything that is wrong with it, below their number."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        lines = [f"  {line}" for problem in self.problems for line in str(problem).split("\n")]
        super().__init__("\n".join([f"{counted(len(self.problems), 'problem')}:", *lines]))


class BadInput(Exception):
    """Input that cannot be used. The message is one line: where (file, topic, record), what, and what to do."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


MAX_WORD, MAX_LINE = 300, 990
"""Characters of a word and of a line in a message."""


def one_line(text: str) -> str:
    """A text on one line, without what a terminal does not show; what is very long is cut short."""
    words = (word if len(word) <= MAX_WORD else f"{word[:MAX_WORD]}…" for word in text.split())
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(words))
    return line if len(line) <= MAX_LINE else f"{line[:MAX_LINE]}…"


def shown(value: Any) -> str:
    """A value as messages name it: its kind where it is a mapping or a list, and the beginning where it is long."""
    return f"a {type(value).__name__}" if isinstance(value, Mapping | list | tuple | set) else cut(value)


def cut(value: Any) -> str:
    """A value as it would be written, cut short where it is long."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of more digits than Python prints
        return f"a {type(value).__name__} of very many digits"
    return text if len(text) <= 60 else f"{text[:57]}…"


HINTS = {
    errno.ENOSPC: "free some space",
    errno.EDQUOT: "free some space",
    errno.EFBIG: "a file may not grow so large; raise the limit (`ulimit -f`), or name another disk",
    errno.EROFS: "nothing can be written there; name another place, of a run: runs=FOLDER cache=FOLDER/.cache",
    errno.EACCES: "it cannot be read or written by you; name another (for runs, type runs=FOLDER)",
    errno.EPERM: "it cannot be read or written by you; name another (for runs, type runs=FOLDER)",
    errno.ENAMETOOLONG: "a name has at most 255 characters, and a path 4095",
    errno.ELOOP: "these links lead to each other; name a file",
    errno.ENOENT: "is its folder there?",
    errno.ENOTDIR: "a part of its path is a file; name another",
    errno.EISDIR: "name a file",
    errno.EIO: "the disk cannot be read or written; name another place",
    errno.EMFILE: "too many files are open; close other programs, or raise the limit (`ulimit -n`)",
    errno.ENXIO: "name a file",
    errno.ESTALE: "the folder is gone; change to another",
}
"""Advice where a file or folder cannot be used, by the system's number of the error."""


def as_bad_input(error: BaseException) -> BadInput | None:
    """Advice on an error that no reader has put into words; None where it is a defect of ours."""
    if isinstance(error, OSError):
        file = error.filename if error.filename2 is None else error.filename2  # of a copy, the file that it makes
        where = "" if file is None else f"{file}: "
        number = error.errno or 0
        if error.strerror != os.strerror(number):  # words of ours on what to do
            return BadInput(f"{where}{error.strerror or error}")
        hint = HINTS.get(number, "name another" if where else "the system does not name the file")
        return BadInput("; ".join([f"{where}{error.strerror}", hint, *getattr(error, "__notes__", ())]))
    if isinstance(error, MemoryError):
        return BadInput("there is no memory left; close other programs, or raise the limit (`ulimit -v`)")
    yaml, omegaconf = sys.modules.get("yaml"), sys.modules.get("omegaconf.errors")  # who met their errors has them
    if omegaconf is not None and isinstance(error, omegaconf.OmegaConfBaseException):
        return BadInput(f"{getattr(error, 'full_key', None) or 'configuration'}: {str(error).splitlines()[0]}")
    if yaml is None or not isinstance(error, yaml.YAMLError):
        return None
    mark, message = getattr(error, "problem_mark", None), getattr(error, "problem", None) or str(error).split("\n")[0]
    where = f"{mark.name}, line {mark.line + 1}, column {mark.column + 1}" if mark else "a configuration file"
    return BadInput(
        f"{where}: not valid YAML: {message}; check indentation, colons, quotes and brackets around this place"
    )


def counted(number: int, noun: str) -> str:
    """A number of things: `1 frame`, `1,200 frames`."""
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def nearest(name: str, options: Iterable[str], least: float = 0.5) -> str | None:
    """The option most like `name`, None where none is like it (`least`: how much, from 0 to 1)."""
    found = difflib.get_close_matches(name, list(options), n=1, cutoff=least)
    return found[0] if found else None


def suggest(name: str, options: Iterable[str], kind: str, prefix: str = "", suffix: str = "") -> str:
    """A hint for a mistyped name: the nearest one where there is one, then all that exist, unless they are many."""
    options = sorted(options)
    listing = f"{kind}: {', '.join(options)}" if options else f"there are no {kind}"
    near = nearest(name, options)
    if near is None:
        return listing
    found = f"did you mean '{prefix}{near}{suffix}'?"
    return f"{found} {listing}" if len(options) <= MAX_LISTED else f"{found} (one of {len(options)})"
