import dataclasses
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Outputs, Stage, State, Tick, Value
from omninav.pipeline.graph.tool import Tool
from toys import Ledger


class Places(Value):
    poses: Any
    names: tuple[str, ...]


def test_a_large_value_is_said_in_a_line_and_a_small_array_whole() -> None:
    said = repr(Places(np.zeros((1000, 3)), ("kitchen",) * 1000))
    assert said.startswith("Places(poses=<float64 of (1000, 3)>, names=('kitchen', ")
    assert len(said) < 150
    assert repr(Places(np.eye(2), ())) == f"Places(poses={np.eye(2)!r}, names=())"
    nine, ten = (Places(np.arange(float(size)), ()) for size in (9, 10))
    assert (repr(nine)[:18], repr(ten)) == ("Places(poses=array", "Places(poses=<float64 of (10,)>, names=())")


@pytest.mark.parametrize("base", [Value, Outputs, State, Stage, Tool])
def test_each_is_only_itself_and_values_are_not_changed_but_those_that_say_so(base: Any) -> None:
    kind: Any = type("Made", (base,), {"__annotations__": {"size": int}, "size": 1, "__module__": __name__})
    kind.__abstractmethods__ = frozenset()
    one = kind(size=2)
    assert (one.size, one == kind(size=2), len({one, one})) == (2, False, 1)
    with nullcontext() if base is Value else pytest.raises(TypeError, match="positional"):
        kind(2)
    with pytest.raises(dataclasses.FrozenInstanceError) if base in (Value, Outputs) else nullcontext():
        one.size = 3
    Ledger([]).entries = [1.0]
    assert repr(Tick(3, 4)) == "Tick(index=3, stamp=4, log=0, frame=0, first_of_log=False)"
