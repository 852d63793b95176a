from typing import Any

import numpy as np

from omninav.pipeline import Value


class Places(Value):
    poses: Any
    names: tuple[str, ...]


def test_a_large_value_is_said_in_a_line() -> None:
    said = repr(Places(np.zeros((1000, 3)), ("kitchen",) * 1000))
    assert said.startswith("Places(poses=<float64 of (1000, 3)>, names=('kitchen', ")
    assert len(said) < 150


def test_a_small_array_is_said_whole() -> None:
    assert repr(Places(np.eye(2), ())) == f"Places(poses={np.eye(2)!r}, names=())"
