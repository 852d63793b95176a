"""Arguments of a command, before anything reads them as a configuration: flags, and what no word may hold."""

import re
from argparse import SUPPRESS, ArgumentParser, Namespace
from collections.abc import Mapping, Sequence, Sized
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from omninav.pipeline.graph.problems import BadInput, nearest, shown

from .config_groups import settings_left_open

MAX_WORD = 10_000
"""Characters of a word."""
MAX_NESTING = 20
"""Brackets within each other in a word."""
MAX_DIGITS = 100
"""Digits of a whole number."""
_LONG_NUMBER = re.compile(rf"(?<![\w.])[-+]?\d{{{MAX_DIGITS},}}")
INFO = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
NOT_TAKEN = {"experimental_rerun": (), "config_path": ("-cp",), "config_name": ("-cn",), "shell_completion": ("-sc",)}
"""Flags of Hydra that would read pickles, replace omninav's own configuration or write to a shell's start files."""
OF_THE_EXPERIMENT = ("experiment", "profile", "runs", "cache", "executor", "hydra")
"""Settings of a whole experiment; all others are for its conditions."""


def read_flags(arguments: Sequence[str]) -> Namespace:
    """Hydra's flags among arguments, and the `overrides`. Raises `BadInput` where one is not taken."""
    parser = flags_parser()
    known = [flag for action in parser._actions for flag in action.option_strings]
    parser.error = partial(_refuse, known)  # type: ignore[method-assign]
    read = parser.parse_intermixed_args(list(arguments))  # flags may occur between words
    for name in NOT_TAKEN:
        if getattr(read, name, None):
            raise BadInput(f"--{name.replace('_', '-')}: omninav does not take this flag; `omninav --help` lists them")
    if read.config_dir and not Path(read.config_dir).is_dir():
        raise BadInput(
            f"--config-dir: there is no folder {read.config_dir}; it holds groups, as FOLDER/match/mine.yaml"
        )
    return read


def flags_parser() -> ArgumentParser:
    """The flags that omninav shares with Hydra, and those of Hydra that it refuses by name."""
    parser = ArgumentParser(add_help=False)
    parser.add_argument("overrides", nargs="*", help="settings, as name=value")
    parser.add_argument("--multirun", "-m", action="store_true", help="run a job for each value of a list")
    parser.add_argument("--config-dir", "-cd", help="a folder with groups of configuration of one's own")
    parser.add_argument("--cfg", "-c", choices=["job", "hydra", "all"], help="show the configuration, and run nothing")
    parser.add_argument("--resolve", action="store_true", help="with --cfg: put values in place of interpolations")
    parser.add_argument("--package", "-p", help="with --cfg: show this part of the configuration")
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=INFO, help="show how Hydra composes it")
    parser.add_argument("--hydra-help", action="store_true", help="Hydra's help")
    parser.add_argument("--help", "-h", action="store_true", help="omninav's help")
    parser.add_argument("--run", "-r", action="store_true", help="run one job, as without flags")
    for name, short in NOT_TAKEN.items():
        takes = "store_true" if name == "shell_completion" else "store"
        parser.add_argument(f"--{name.replace('_', '-')}", *short, action=takes, help=SUPPRESS)
    return parser


def refuse_twice(arguments: Sequence[str]) -> None:
    """Raise `BadInput` where the variant, or what it is run on, is typed twice: the first would be passed over."""
    given: dict[str, str] = {}
    for name, _, value in (word.partition("=") for word in arguments if "=" in word):
        if given.setdefault(name, value) != value and name in ("variant", *settings_left_open()):
            both = f" (both, where it takes several: '{name}=[{given[name]},{value}]')" if name != "variant" else ""
            raise BadInput(f"{name}: {given[name]:.100} and {value:.100} are typed; leave one of them out{both}")


def without_flags(arguments: Sequence[str]) -> list[str]:
    """The words of a command that composes nothing; flags of Hydra change nothing there. Raises `BadInput`."""
    flags = any(word.startswith("-") for word in arguments)
    return list(read_flags(arguments).overrides) if flags else list(arguments)


def _refuse(known: Sequence[str], message: str) -> NoReturn:
    what, _, flag = message.partition("unrecognized arguments: ")
    if flag and not what:
        name, _, value = flag.split()[0].lstrip("-").partition("=")
        near = nearest(f"--{name}", known, 0.75)
        hint = f"did you mean {near}?" if near else f"settings have no dashes: type {name}={value or '…'}"
        raise BadInput(f"{flag.split()[0]:.60}: there is no such flag; {hint}")
    if "ignored explicit argument" in message:  # -help is -h with something behind it
        raise BadInput("a short flag is a single letter; did you mean --help? `omninav --help` shows what to type")
    raise BadInput(f"{message}; `omninav --help` shows what to type")


def condition_arguments(words: Sequence[str]) -> list[str]:
    """Gives the words that are for each condition of an experiment and not for the experiment itself."""
    keys = [word.lstrip("+~").partition("=")[0].replace("/", ".").partition(".")[0] for word in words]
    if "experiment" not in keys:
        return []
    return [word for word, key in zip(words, keys, strict=True) if key not in OF_THE_EXPERIMENT]


def refuse_unreadable(arguments: Sequence[str]) -> None:
    """Raise `BadInput` for a word that is no text, or so long or nested that reading it would take for ever."""
    for word in arguments:
        what = _unreadable(word)
        if what:
            raise BadInput(f"{shown(word)}: this word cannot be read: {what}")


def _unreadable(word: str) -> str:
    what = ""
    if len(word) > MAX_WORD:
        what = f"it has {len(word):,} characters, expected at most {MAX_WORD:,}"
    elif "\0" in word or any("\ud800" <= character <= "\udfff" for character in word):
        what = "it is not text (UTF-8 without NUL)"
    elif _depth(word) > MAX_NESTING:
        what = f"it has more than {MAX_NESTING} brackets within each other"
    elif _LONG_NUMBER.search(word):
        what = f"it holds a number of more than {MAX_DIGITS} digits"
    return what


def _depth(word: str) -> int:
    depth = deepest = 0
    for character in word:
        depth += (character in "([{") - (character in ")]}")
        deepest = max(deepest, depth)
    return deepest


def value_text(value: Any, depth: int = 0) -> str:
    """A value as it is typed behind `name=`, quoted where it is a text with odd characters.

    `depth`: how many lists it is within. Raises `BadInput` for what no word can hold, before it is written out.
    """
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a number of numpy, some of which are floats
        return value_text(value.item(), depth)
    if isinstance(value, int | float):
        if isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
            raise BadInput(f"a whole number of more than {MAX_DIGITS} digits cannot be a setting")
        return repr(value)
    if isinstance(value, str | Path):
        text = str(value) if isinstance(value, str) else str(value).replace("${", "\\${")
        return text if text and all(c.isalnum() or c in "_./-" for c in text) else _quoted(text)
    if isinstance(value, Mapping | list | tuple | range):
        if number_of(value) > MAX_WORD or depth >= MAX_NESTING:
            what = f"of {number_of(value):,} items" if depth < MAX_NESTING else f"within {MAX_NESTING} others"
            least = f"expected at most {MAX_WORD:,}, and {MAX_NESTING} within each other"
            raise BadInput(f"a {type(value).__name__} {what} cannot be a setting; {least}")
        if isinstance(value, Mapping):
            return "{" + ",".join(f"{name}:{value_text(item, depth + 1)}" for name, item in value.items()) + "}"
        return "[" + ",".join(value_text(item, depth + 1) for item in value) + "]"
    raise BadInput(f"a {type(value).__name__} cannot be a setting; give a number, a text, a path, or a list of them")


def number_of(values: Sized) -> int:
    """Counts the values, of a range of any length too."""
    if isinstance(values, range):
        return max(0, -((values.start - values.stop) // values.step))
    return len(values)


def _quoted(text: str) -> str:
    # Hydra takes a backslash for itself but before a quote.
    return "'" + re.sub(r"(\\*)('|$)", lambda end: 2 * end[1] + ("\\'" if end[2] else ""), text) + "'"
