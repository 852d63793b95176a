"""Python values as the words of a command line."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omninav.pipeline.graph.problems import BadInput, shown


def words_of(words: tuple[str, ...], settings: Mapping[str, Any]) -> list[str]:
    """Words as they would be typed: `"omniview_mcl", seed=3` is `variant=omniview_mcl seed=3`.

    A first word without `=` is a variant's name. Raises `BadInput` for a value that no word can hold.
    """
    typed = [_checked(word) for word in words]
    if typed and typed[0].isidentifier():
        typed[0] = f"variant={typed[0]}"
    return [*typed, *(f"{name}={word_of(value)}" for name, value in settings.items())]


def _checked(word: Any) -> str:
    if not isinstance(word, str):
        raise BadInput(f"{shown(word)}: expected words as on the command line, such as 'variant=omniview_mcl'")
    return word


def word_of(value: Any) -> str:
    """A value as it stands behind `name=`, quoted where it is a text with odd characters."""
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a number of numpy
        return word_of(value.item())
    if isinstance(value, str | Path):
        text = str(value)
        return text if text and all(c.isalnum() or c in "_./-" for c in text) else _quoted(text)
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{name}:{word_of(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list | tuple | range):
        return "[" + ",".join(map(word_of, value)) + "]"
    raise BadInput(f"a {type(value).__name__} cannot be a setting; give a number, a text, a path, or a list of them")


def _quoted(text: str) -> str:
    backslash = "\\"
    return "'" + text.replace(backslash, 2 * backslash).replace("'", f"{backslash}'") + "'"
