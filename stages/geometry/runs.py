"""Arrays that hold runs of rows, one after another."""

import numpy as np

from .arrays import Ints


def chosen_runs(starts: Ints, chosen: Ints) -> tuple[Ints, Ints]:
    """The rows (K,) of some runs (N,), in their order, and where each of these then begins in them: (N + 1,).

    Run r is rows `starts[r]` to `starts[r + 1]`; the number one past the last run is of one without rows.
    """
    sizes = np.append(np.diff(starts), 0)[chosen]
    begins = np.cumsum(np.append(0, sizes), dtype=np.int64)
    return np.repeat(starts[chosen] - begins[:-1], sizes) + np.arange(begins[-1]), begins
