import dataclasses
from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Outputs, Stage, State, Value
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


def test_what_travels_or_is_kept_is_only_itself_and_is_not_changed_unless_it_says_so() -> None:
    def made(base: type) -> type:
        return type("Made", (base,), {"__annotations__": {"size": int}, "size": 1, "__module__": __name__})

    for base, keyword_only, frozen in ((Value, 0, 1), (Outputs, 1, 1), (State, 1, 0), (Stage, 1, 0), (Tool, 1, 0)):
        kind: Any = made(base)
        kind.__abstractmethods__ = frozenset()
        one = kind(size=2)
        assert (one.size, one == kind(size=2), len({one, one})) == (2, False, 1), base
        if keyword_only:
            with pytest.raises(TypeError, match="positional"):
                kind(2)
        if frozen:
            with pytest.raises(dataclasses.FrozenInstanceError):
                one.size = 3
    ledger = Ledger([])
    ledger.entries = [1.0]
    assert ledger.entries == [1.0]
