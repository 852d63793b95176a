"""Arrays that grow row by row inside a value that is updated in place."""

from typing import Any

import numpy as np
import numpy.typing as npt


class GrowableArrays:
    """Mixin of in-place values whose array fields grow: `append` is cheap, however many rows there are."""

    def put(self, **fields: object) -> None:
        """Set fields."""
        for name, value in fields.items():
            setattr(self, name, value)

    def append(self, name: str, row: Any) -> None:
        """Add a row to an array field. The field is then a view of an array with room to grow.

        The room doubles when it is full, so that N appends copy O(N) rows.
        """
        rows: npt.NDArray[Any] = getattr(self, name)
        rooms: dict[str, npt.NDArray[Any]] = self.__dict__.setdefault("_rooms", {})
        room = rooms.get(name)
        if room is None or rows.base is not room or len(rows) == len(room):
            room = rooms[name] = np.empty((max(64, 2 * len(rows)), *rows.shape[1:]), rows.dtype)
            room[: len(rows)] = rows
        room[len(rows)] = row
        setattr(self, name, room[: len(rows) + 1])
