"""Drives as a map of views may be learned from again: their views, and the odometry between them."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Bools, Floats, Ints
from omninav.stages.geometry.plane.se2 import chain, compose

from .growable_arrays import GrowableArrays
from .views import WholeView


class Sessions(GrowableArrays, Value):
    """Views of one or more drives in the order in which they were seen. Changed in place by the stage that keeps them.

    `views` (N, H, D): the rows of each (`WholeView.rows`); `sample`: one of them, for their kind. `motions` (N, 3): by
    odometry from the view before, in its frame (m, m, rad); 0 where a drive begins. `begins` (N,): a drive begins here.
    `believed` (N, 3): the pose that the system believed (m, m, rad), where it was `sure` (N,) of one. `ticks` (N,): in
    which each was seen; 0 for those of earlier runs. `since` (3,): motion since the last view that was kept.
    """

    in_place = True

    sample: WholeView
    views: Annotated[Floats, Shape("N", "H", "D")]
    motions: Annotated[Array, Shape("N", 3)]
    begins: Annotated[Bools, Shape("N")]
    believed: Annotated[Array, Shape("N", 3)]
    sure: Annotated[Bools, Shape("N")]
    ticks: Annotated[Ints, Shape("N"), Bounds(ge=0)]
    since: Annotated[Array, Shape(3)]

    @classmethod
    def empty(cls, sample: WholeView) -> "Sessions":
        """No view yet; they will be of the kind of `sample`."""
        views, three, flag = np.empty((0, *sample.rows.shape), np.float32), np.empty((0, 3)), np.empty(0, np.bool_)
        return cls(sample, views, three, flag, three, flag, np.empty(0, np.int64), np.zeros(3))

    def __len__(self) -> int:
        return len(self.views)

    def keep(self, view: WholeView, believed: Array | None, begins: bool, tick: int) -> None:
        """Add a view, seen after the motion `since` the last one; `believed` (3,), None: in several poses or none."""
        self.append("views", view.rows)
        self.append("motions", np.zeros(3) if begins else self.since)
        self.append("begins", np.bool_(begins))
        self.append("believed", np.zeros(3) if believed is None else believed)
        self.append("sure", np.bool_(believed is not None))
        self.append("ticks", np.int64(tick))
        self.put(since=np.zeros(3))

    def move(self, motion: Array) -> None:
        """Count a motion (3,) since the last view."""
        self.put(since=compose(self.since, motion))

    def view(self, row: int) -> WholeView:
        """One of the views."""
        return self.sample.like(self.views[row])

    @property
    def values(self) -> Floats:
        """Vectors that a map keeps of each view: (N, D)."""
        return self.views[:, 0]

    @property
    def drives(self) -> Ints:
        """The drive of each view, numbered from 0: (N,)."""
        numbers: Ints = np.maximum(np.cumsum(self.begins) - 1, 0)
        return numbers

    @property
    def driven(self) -> Array:
        """Metres from the start of the first drive to each view along all drives: (N,)."""
        metres: Array = np.cumsum(np.hypot(self.motions[:, 0], self.motions[:, 1]))
        return metres

    @property
    def by_odometry(self) -> Array:
        """Pose of each view in the frame in which its drive begins, at the origin: (N, 3)."""
        drives = self.drives
        parts = [chain(self.motions[drives == drive]) for drive in np.unique(drives)]
        return np.concatenate([np.empty((0, 3)), *parts])
