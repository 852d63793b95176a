"""Plain values as the types that parameters ask for."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest

from omninav.pipeline import Bounds
from omninav.pipeline.graph.ports import convert


@dataclasses.dataclass(frozen=True)
class Fixed:
    kind: Literal["fixed"]
    speed: float = 1.0


@dataclasses.dataclass(frozen=True)
class Drawn:
    kind: Literal["drawn"]
    speeds: tuple[float, float]


@pytest.mark.parametrize(
    ("value", "kind", "found"),
    [
        (3, float, 3.0),
        ("a/b", Path, Path("a/b")),
        ((1, "x"), tuple[int, str], (1, "x")),
        ({1: 2}, Mapping[str, float], {"1": 2.0}),
        (2, Annotated[int, Bounds(ge=2)] | None, 2),
        (False, bool | str, False),
        (True, Literal["auto", True], True),
        ({"kind": "drawn", "speeds": [1, 2]}, Fixed | Drawn, Drawn("drawn", (1.0, 2.0))),
        (True, int, "p: True (bool), expected int"),
        (None, int | str, "p: None (NoneType), expected int | str"),
        (float("inf"), float, "p: inf (float), expected float"),
        (True, Literal[1, "one"], "p: True (bool), expected 1 | 'one'"),
        ([1, "x", "y"], list[int], "p[1]: 'x' (str), expected int\np[2]: 'y' (str), expected int"),
        ([1], tuple[int, int], "p: [1] (list), expected [int, int]"),
        ({"a": "x"}, dict[str, int], "p.a: 'x' (str), expected int"),
        ({"kind": "drwan"}, Fixed | Drawn, "p.kind: 'drwan' (str), expected 'fixed' | 'drawn'"),
        ({"kind": "drawn"}, Fixed | Drawn, "p.speeds: missing, expected [float, float]"),
        ("x", Sequence[Any] | None, "p: 'x' (str), expected list of anything"),
    ],
)
def test_a_value_passes_as_what_it_can_only_mean_or_says_what_was_expected(value: Any, kind: Any, found: Any) -> None:
    converted, problems = convert(value, kind, "p")
    given = "\n".join(f"{each.where}: {each.what}" for each in problems) if problems else converted
    assert (given, type(given)) == (found, type(found))


def test_a_word_is_like_one_of_the_choices_of_a_union() -> None:
    ((problem,),) = [convert("atuo", int | Literal["auto", "none"], "p")[1]]
    assert problem.hint == "did you mean 'auto'?"
