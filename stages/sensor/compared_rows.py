"""Index from a reference to its row among the candidates."""

import numpy as np

from omninav.stages.geometry.arrays import Ints


class ComparedRows:
    """Each thing's row among those that were compared, -1 where it was not.

    The array is kept from view to view, and only what was compared is written, since there may be many things.
    """

    def __init__(self, number: int) -> None:
        self._rows = np.full(number, -1, np.int64)
        self._all = np.arange(number)
        self._written: Ints = self._all[:0]

    def of(self, compared: Ints | None) -> tuple[Ints, Ints]:
        """Compared references (None: all), and each one's row among them. Valid until the next call."""
        if compared is None and self._written is self._all:
            return self._written, self._rows
        self._rows[self._written] = -1
        self._written = self._all if compared is None else compared
        self._rows[self._written] = self._all[: len(self._written)]
        return self._written, self._rows
