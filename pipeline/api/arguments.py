"""Python values as arguments of a command."""

from collections.abc import Mapping
from typing import Any

from omninav.pipeline.cli.arguments import value_text
from omninav.pipeline.graph.problems import BadInput, shown
from omninav.pipeline.graph.results import by_path


def arguments_of(words: tuple[str, ...], settings: Mapping[str, Any]) -> list[str]:
    """Words as they would be typed: `"omniview_mcl", seed=3` is `variant=omniview_mcl seed=3`.

    A first word without `=` is a variant's name; a dictionary's keys are names below its own, as in
    `nodes={"match": {"size": 72}}`. Raises `BadInput` for a value that no word can hold.
    """
    typed = [_checked(word) for word in words]
    if typed and typed[0].isidentifier():
        typed[0] = f"variant={typed[0]}"
    return [*typed, *(setting_argument(name, value) for name, value in by_path(settings))]


def setting_argument(name: str, value: Any) -> str:
    """A setting as it would be typed. Raises `BadInput` for a value that no word can hold."""
    try:
        return f"{name}={value_text(value)}"
    except BadInput as refused:
        raise BadInput(f"{name}: {refused}") from None


def _checked(word: Any) -> str:
    if not isinstance(word, str):
        raise BadInput(f"{shown(word)}: expected words as on the command line, such as 'variant=omniview_mcl'")
    return word
