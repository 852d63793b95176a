"""Landmarks of a map, and the pose of an image that sees them."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Value
from omninav.pipeline.graph.contents import Covariances, RowsOf, Shape, Starts

from .visual_words import VisualWords

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]

DESCRIPTOR_SCALE = 512.0
"""Stored value of a descriptor's 1: of RootSIFT no number is larger than a half in practice."""


class Landmarks(Value):
    """Points of the world that several references of a map see, with what they look like, and the references' words.

    `points` (L, 3) float32: x, y (m) in the map frame, z (m) above the camera's projection centre. `descriptors` (L, D)
    uint8: the mean of each point's descriptors as `stored_descriptors` makes them. Of reference r the points that it
    sees are `seen[starts[r]]` to `seen[starts[r + 1]]` (S,). `sigma_rad`: standard deviation of a bearing, as the map's
    own images miss its points. `words`: the visual words of the references, by which candidates are found.
    """

    points: Annotated[Floats, Shape("L", 3)]
    descriptors: Annotated[Bytes, Shape("L", "D")]
    starts: Annotated[Ints, Shape("R+1"), Starts("S")]
    seen: Annotated[npt.NDArray[np.int32], Shape("S"), RowsOf("L")]
    sigma_rad: Annotated[float, Bounds(gt=0)]
    words: Annotated[VisualWords, Shape("R")]

    def __len__(self) -> int:
        return len(self.points)

    @property
    def references(self) -> int:
        """Number of references."""
        return len(self.starts) - 1

    def seen_by(self, references: Ints) -> Ints:
        """Rows (N,) of the points that any of some references sees, ascending."""
        shown = np.zeros(len(self), np.bool_)
        for reference in references.tolist():
            shown[self.seen[self.starts[reference] : self.starts[reference + 1]]] = True
        return np.flatnonzero(shown)


def stored_descriptors(values: Floats) -> Bytes:
    """Rows (N, D) of length 1 as they are stored, a byte each."""
    return np.asarray(np.clip(np.rint(values * np.float32(DESCRIPTOR_SCALE)), 0, 255).astype(np.uint8), np.uint8)


class LandmarkFix(Value):
    """Poses from which an image may have been taken, each by the landmarks that it saw from there, the best first.

    `poses` (K, 3): x, y (m), heading (rad), map frame. `covariances` (K, 3, 3): m, m, rad. `inliers` (K,): how many
    landmarks agree. `matches`: how many were compared. `probabilities` (K,): that each is right; their sum is at most
    1, and the rest is that none is.
    """

    poses: Annotated[Array, Shape("K", 3)]
    covariances: Annotated[Array, Shape("K", 3, 3), Covariances()]
    inliers: Annotated[Ints, Shape("K"), Bounds(ge=0)]
    probabilities: Annotated[Array, Shape("K"), Bounds(ge=0, le=1)]
    matches: Annotated[int, Bounds(ge=0)]

    def __len__(self) -> int:
        return len(self.poses)
