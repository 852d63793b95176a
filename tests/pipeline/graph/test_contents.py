"""A value says what its fields hold, and what does not fit is named."""

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt
import pytest

from omninav.pipeline import Bounds, Value
from omninav.pipeline.graph import contents
from omninav.pipeline.graph.contents import MAX_MAGNITUDE, Covariances, RowsOf, Shape, Starts, violation

Reals = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class Part(Value):
    length: Annotated[float, Bounds(gt=0)]


class Stated(Value):
    points: Annotated[Reals, Shape("N", 2)]
    names: Annotated[tuple[str, ...], Shape("N")]
    pairs: Annotated[Ints, Shape("E", 2), RowsOf("N")]
    starts: Annotated[Ints, Shape("G+1"), Starts("N")]
    spread: Annotated[Reals, Shape("E", 2, 2), Covariances()]
    shares: Annotated[Reals, Shape("S"), contents.Shares()]
    ways: Annotated[Reals, Shape("W", 2), contents.UnitRows()]
    counts: dict[str, int]
    spot: tuple[float, str] | None
    kind: Literal["one", "other"]
    part: Part | None
    free: Reals
    """Says nothing of its shape, so it may be anything."""


def stated(**changes: object) -> Stated:
    fields = {
        "points": np.zeros((3, 2)),
        "names": ("a", "b", "c"),
        "pairs": np.array([[0, 2]]),
        "starts": np.array([0, 1, 3]),
        "spread": np.eye(2)[None],
        "shares": np.array([0.25, 0.75]),
        "ways": np.array([[0.6, 0.8], [0.0, 0.0], [0.0, 1.0009]]),
        "counts": {"a": np.int64(1)},
        "spot": (1, "a"),
        "kind": "one",
        "part": Part(1.0),
        "free": np.array(np.nan),
    }
    return Stated(**fields | changes)


def test_a_value_that_holds_what_it_states_is_sound():
    assert violation(stated()) is None
    assert violation(stated(part=None, spot=None, shares=np.zeros(0))) is None
    assert violation(stated(shares=np.array([0.25, 0.75 + 0.9e-4]))) is None
    assert violation(stated(points=np.full((3, 2), -MAX_MAGNITUDE), free=np.full(3, np.inf))) is None
    assert violation(stated(points=np.full((3, 2), MAX_MAGNITUDE))) is None
    small_and_large = np.eye(2) * np.array([1e-9, 1.0, 1e9])[:, None, None]
    assert violation(stated(spread=small_and_large, pairs=np.zeros((3, 2), np.int64))) is None


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"points": np.zeros(6)}, "'points' has the shape (6,), expected (N, 2)"),
        ({"names": ("a", "b")}, "'names' has the shape (2,), expected (N,), N = 3"),
        ({"points": np.full((3, 2), np.nan)}, "'points' holds nan, expected finite numbers"),
        ({"points": np.full((3, 2), 10 * MAX_MAGNITUDE)}, "up to 1e+15"),
        ({"points": np.zeros((3, 2), np.float32)}, "'points' is an array of float32"),
        ({"points": np.zeros((3, 2), ">f8")}, "'points' is an array of >f8"),
        ({"pairs": np.array([[0, 3]])}, "'pairs' names a row that does not exist, expected 0 to 2"),
        ({"pairs": np.array([[0, -1]])}, "'pairs' names a row that does not exist"),
        ({"starts": np.array([0, 2, 1, 3])}, "'starts' does not ascend from 0 to 3"),
        ({"starts": np.array([0, 2])}, "'starts' does not ascend from 0 to 3"),
        ({"starts": np.array([], np.int64)}, "'starts' has the shape (0,)"),
        ({"spread": np.array([[[1.0, 2.0], [2.0, 1.0]]])}, "'spread' holds a matrix that is no covariance"),
        ({"spread": np.array([[[1.0, 0.1], [0.0, 1.0]]])}, "'spread' holds a matrix that is no covariance"),
        ({"spread": np.diag([1.0, 0.0])[None]}, "'spread' holds a matrix that is no covariance"),
        ({"starts": np.array([1, 2, 3])}, "'starts' does not ascend from 0 to 3"),
        ({"shares": np.array([0.25, 0.75 + 1.1e-4])}, "'shares' holds 0.25 and sums to 1.00011, expected shares of 1"),
        ({"shares": np.array([-0.25, 1.25])}, "'shares' holds -0.25 and sums to 1"),
        ({"ways": np.array([[0.6, 0.8], [0.0, 1.0011]])}, "'ways' holds a vector of length 1.0011, expected 1"),
        ({"counts": {"a": True}}, "'counts' is dict, not mapping to int"),
        ({"counts": {1: 1}}, "'counts' is dict, not mapping to int"),
        ({"spot": (1.0,)}, "'spot' is tuple, not [float, str] | null"),
        ({"spot": (True, "a")}, "'spot' is tuple, not [float, str] | null"),
        ({"kind": "third"}, "'kind' is 'third', not 'one' | 'other'"),
        ({"names": [1, 2, 3]}, "'names' is list, not list of str"),
        ({"part": Part(-1.0)}, "'part': 'length' holds -1, expected > 0"),
        ({"part": Part(2**70)}, "'part': 'length' holds 1.18059e+21, expected finite numbers up to"),
        ({"part": "x" * 1000}, "'part' is 'xxxx"),
    ],
)
def test_what_does_not_fit_is_named(changes: dict[str, object], said: str):
    wrong = violation(stated(**changes))
    assert wrong is not None
    assert said in wrong
    assert len(wrong) < 200


def test_an_output_is_of_its_type_or_missing_where_it_may_be():
    assert contents.wrong_output(Part(1.0), Part, False) is contents.wrong_output(None, Part, True) is None
    assert contents.wrong_output(None, Part, False) == "is missing, expected Part; write `Part | None`"
    assert contents.wrong_output(3, Part, True) == "is 3, expected Part"
    assert contents.wrong_output(Part(0.0), Part, True) == "is not a valid Part: 'length' holds 0, expected > 0"
