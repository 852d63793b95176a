"""Words of a command line that were meant otherwise: flags before a command, spaces around `=`, typographic dashes.

A shell splits such words or passes them on unchanged; without this, errors would be about something else.
"""

from collections.abc import Sequence
from pathlib import Path

from .arguments import value_text

WITH_VALUE = ("--config-dir", "-cd", "--cfg", "-c", "--package", "-p", "--config-name", "-cn", "--config-path", "-cp")
"""Flags whose value is the next word."""
DASHES = "\u2010\u2011\u2012\u2013\u2014\u2015\u2212"
QUOTES = "\u2018\u2019\u201a\u201c\u201d\u201e\u00ab\u00bb"
SPACES = "\u00a0\u2007\u202f"


def command_first(arguments: Sequence[str]) -> list[str]:
    """The words, with flags typed before a command behind it."""
    flags = 0
    while flags < len(arguments) and arguments[flags].startswith("-"):
        flags += 2 if arguments[flags] in WITH_VALUE else 1
    named = arguments[flags : flags + 1]
    return [*arguments[flags:], *arguments[:flags]] if named and named[0].isidentifier() else list(arguments)


def with_homes(arguments: Sequence[str]) -> list[str]:
    """The words, with `name=~/…` as the path that is meant: a shell leaves it as it is, and Hydra cannot read it."""
    return [_with_home(word) for word in arguments]


def _with_home(word: str) -> str:
    name, _, value = word.partition("=")
    return f"{name}={value_text(Path(value).expanduser())}" if value == "~" or value.startswith("~/") else word


def mistyped_word(arguments: Sequence[str]) -> str:
    """Advice on the first word that cannot be meant as typed; '' where there is none."""
    for number, word in enumerate(arguments):
        before = arguments[number - 1] if number else ""
        after = arguments[number + 1] if number + 1 < len(arguments) else ""
        head, _, value = word.partition("=")
        name = word.rstrip("=")
        if word[:1] and word[0] in DASHES:
            return f"{word:.60}: this begins with a typographic dash; type --{word.lstrip(DASHES + '-'):.60}"
        if any(mark in QUOTES for mark in head[:1] + value[:1]) and not Path(value or head).exists():
            return f"{word:.60}: these are typographic quotes; type ' or \" in their place"
        if any(space in head for space in SPACES) and not Path(head).exists():
            return f"{word:.60}: a space in it is a no-break space; type it again"
        if word == "=":
            return f"no spaces around =: type {before or 'NAME'}={after or 'VALUE'}"
        if word.startswith("="):
            return f"{word:.60}: there is no name before =: type {before or 'name'}{word:.60}"
        if word in ("+", "++", "~") or head in ("+", "++", "~"):
            return f"{word:.60}: there is no name behind {head or word}: type {head or word}name=value"
        if name != word and "=" not in name and after and "=" not in after and after[:1] not in "-+~":
            return f"no spaces around =: type {word}{after}"
    return ""
