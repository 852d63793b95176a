"""Random generators by purpose."""

import zlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """A generator of its own for each purpose: no draw for one thing can change another."""
    return np.random.default_rng([seed, *(zlib.crc32(str(name).encode()) for name in names)])
