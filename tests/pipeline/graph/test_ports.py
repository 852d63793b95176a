"""Plain values as the types that parameters ask for."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
import pytest

import toys
from omninav.pipeline import Bounds
from omninav.pipeline.graph.ports import compatible, convert, type_name


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
        ({"kind": "drawn", "speeds": [1, 2]}, str | Fixed | Drawn, Drawn("drawn", (1.0, 2.0))),
        ({"kind": "drawn", "speeds": [1, 2]}, dict[str, Any] | int, {"kind": "drawn", "speeds": [1, 2]}),
        (Drawn("drawn", (1.0, 2.0)), Fixed | Drawn, Drawn("drawn", (1.0, 2.0))),
        (2, Annotated[int, Bounds(ge=2, le=2)], 2),
        (1, Annotated[int, Bounds(ge=2)], "p: 1 is out of bounds, expected int >= 2"),
        (2.0, Annotated[float, Bounds(gt=1, lt=2)], "p: 2.0 is out of bounds, expected float > 1 and < 2"),
        ("x", Annotated[int, Bounds(ge=2)], "p: 'x' (str), expected int >= 2"),
        ({"speeds": "x"}, Drawn, "p.speeds: 'x' (str), expected [float, float]\np.kind: missing, expected 'drawn'"),
        ({"sped": 1, "kind": "fixed"}, Fixed, "p.sped: Fixed has no parameter 'sped'"),
        (-1e999, float, "p: -inf (float), expected float"),
        ({}, list[int], "p: a mapping (dict), expected list of int"),
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


@pytest.mark.parametrize(
    ("value", "kind", "hint"),
    [
        ("atuo", int | Literal["auto", "none"], "did you mean 'auto'?"),
        ({"kind": "drwan"}, Fixed | Drawn, "did you mean 'drawn'? choices: drawn, fixed"),
        ({"kind": "fixed", "sped": 1.0}, Fixed, "did you mean 'p.speed'? parameters: kind, speed"),
        ({}, Drawn, "type p.kind=…"),
        ([1], tuple[int, int], "give 2 values"),
        (float("nan"), float, "write a finite number"),
    ],
)
def test_a_value_that_does_not_pass_says_what_to_type(value: Any, kind: Any, hint: str) -> None:
    assert convert(value, kind, "p")[1][0].hint == hint


def test_a_wire_takes_a_value_where_all_that_it_may_be_fits() -> None:
    word_or_whole = toys.Word | toys.Whole
    fitting = [(toys.Whole, toys.Number), (word_or_whole, toys.Number | toys.Word), (Any, toys.Word), (toys.Word, Any)]
    unfit = [(toys.Number, toys.Whole), (word_or_whole, toys.Number), (list, list[int]), (list[int], list)]
    assert [compatible(*pair) for pair in (*fitting, (list[int], list[int]), *unfit)] == [True] * 5 + [False] * 4
    kinds = (toys.Number, None | int, npt.NDArray[np.float64], npt.NDArray[Any], Mapping[str, float], dict[str, Any])
    names = "Number, null | int, an array of float64, an array of anything, mapping to float, mapping"
    assert ", ".join(map(type_name, kinds)) == names
