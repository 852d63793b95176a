"""Maps."""

from dataclasses import replace
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import RowsOf, Shape, Value
from omninav.stages.geometry.appearance.segments import FeatureKind, Rows
from omninav.stages.geometry.arrays import Array, Floats, Ints

from .growable_arrays import GrowableArrays
from .landmarks import Landmarks
from .pose import Pose, PoseSource


class ReferenceGraph(GrowableArrays, Value):
    """Reference views at known poses, joined by edges along the drive (Gross & Koenig 2004, section 2).

    `poses`: (R, 3) x, y (m), heading (rad) of the robot when the view was taken. `features`: (R, segments, bins) in
    the units of the features stage. `kind`: which features these are. `edges`: (E, 2) indices of neighbours along the
    drive. `pose_source`: where the poses come from. `landmarks`: points that the references see, or None. Grows
    in place by `insert` and `join`.

    The features of a map that is larger than 64 MB stay in its file: `features[rows]` (indices, a slice or a mask)
    reads some as a plain array; `features[:]` reads all, for a stage that needs each. A map that grows is in memory.
    """

    in_place = True
    grows = ("poses", "features", "edges")

    poses: Annotated[Array, Shape("R", 3)]
    features: Annotated[Rows, Shape("R", "segments", "bins")]
    kind: FeatureKind
    edges: Annotated[Ints, Shape("E", 2), RowsOf("R")]
    pose_source: PoseSource
    landmarks: Landmarks | None = None

    @classmethod
    def empty(cls) -> "ReferenceGraph":
        """A map with no reference yet; what its features are is settled by the first."""
        features = np.empty((0, 0, 0), np.float32)
        return cls(np.empty((0, 3)), features, "histograms", np.empty((0, 2), np.int64), "truth")

    def __len__(self) -> int:
        return len(self.poses)

    def insert(self, pose: Pose, features: Floats, kind: FeatureKind) -> int:
        """Add a reference and give its index. Raises ValueError where the features are not of the map's shape."""
        if not len(self):
            self.put(kind=kind, features=np.empty((0, *features.shape), np.float32))
        if kind != self.kind or features.shape != self.features.shape[1:]:
            raise ValueError(
                f"a {kind} view of shape {features.shape} in a map of {self.kind} {self.features.shape[1:]}"
            )
        self.append("poses", np.array([pose.x, pose.y, pose.heading]))
        self.append("features", features)
        return len(self) - 1

    def join(self, one: int, other: int) -> bool:
        """Add the edge between two references; False where it was there."""
        low, high = sorted((one, other))
        if low == high or bool(((self.edges[:, 0] == low) & (self.edges[:, 1] == high)).any()):
            return False
        self.append("edges", np.array([low, high], np.int64))
        return True

    def moved(self, poses: Array) -> "ReferenceGraph":
        """The map with its references at other poses (R, 3), and each landmark moved with those that see it."""
        landmarks = None if self.landmarks is None else self.landmarks.moved(self.poses, poses)
        return replace(self, poses=poses, landmarks=landmarks)

    def contradiction(self) -> str | None:
        """Landmarks are of the map's references, or of the first ones of a map that has grown since."""
        if self.landmarks is None or self.landmarks.references <= len(self):
            return None
        return f"'landmarks' are of {self.landmarks.references} references, and the map has {len(self)}"


class ReferenceEvent(Value):
    """Change of a reference graph in a tick: the index of the reference it added, and why."""

    inserted: int
    reason: Literal["first", "far", "unlike"]


def within(poses: Array, x: float, y: float, radius: float) -> Ints:
    """Indices of the poses within `radius` metres of a point, nearest first."""
    gap = np.hypot(poses[:, 0] - x, poses[:, 1] - y)
    near = np.flatnonzero(gap <= radius)
    return near[np.argsort(gap[near], kind="stable")]
