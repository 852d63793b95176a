from typing import Any

import numpy as np

from omninav.pipeline import Value


class Places(Value):
    poses: Any
    names: tuple[str, ...]


def test_a_large_value_is_said_in_a_line_and_a_small_array_whole() -> None:
    said = repr(Places(np.zeros((1000, 3)), ("kitchen",) * 1000))
    assert said.startswith("Places(poses=<float64 of (1000, 3)>, names=('kitchen', ")
    assert len(said) < 150
    assert repr(Places(np.eye(2), ())) == f"Places(poses={np.eye(2)!r}, names=())"
