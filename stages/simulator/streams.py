"""Random generators by purpose."""

import zlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """An independent generator for each purpose, so that draws for one cannot change another."""
    return np.random.default_rng([seed, *(zlib.crc32(str(name).encode()) for name in names)])
