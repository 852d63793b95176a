"""What is kept of a view to find it again from elsewhere: local features, vertical segments, and a global descriptor.

They are three values: homing needs the local features alone, each can be replaced by one wire, and one that is not
wired is absent.
"""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Value
from omninav.pipeline.graph.contents import Shape
from omninav.stages.geometry.appearance.visual_distance import Patches, Segments, ViewFeatures, patches

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Bytes = npt.NDArray[np.uint8]


class LocalFeatures(Value):
    """Patches of a view with what they look like, the strongest first.

    `bearings` (N, 3): unit vectors in the robot's frame, from the camera's projection centre. `points` (N, 2): columns
    and rows (pixels, integers are centres) in the image they were found in. `descriptors` (N, D) uint8, compared by
    Euclidean distance. `colours` (N, 3) float32: correlations of red with green, red with blue, green with blue over
    the patch, in [-1, 1] (Goedeme et al. 2007, equation 1; erratum 25 in docs/papers.md). `sizes` (N,): diameters
    (pixels).
    """

    bearings: Annotated[Array, Shape("N", 3), Bounds(ge=-1.001, le=1.001)]
    points: Annotated[Array, Shape("N", 2, finite=False)]
    descriptors: Annotated[Bytes, Shape("N", "D")]
    colours: Annotated[Floats, Shape("N", 3), Bounds(ge=-1.001, le=1.001)]
    sizes: Annotated[Floats, Shape("N"), Bounds(ge=0)]

    def __len__(self) -> int:
        return len(self.bearings)

    def chosen(self, rows: npt.NDArray[np.int64] | slice) -> "LocalFeatures":
        """Some of them."""
        return LocalFeatures(
            self.bearings[rows], self.points[rows], self.descriptors[rows], self.colours[rows], self.sizes[rows]
        )

    def patches(self) -> Patches:
        """What they are matched by."""
        return patches(self.descriptors, self.colours, self.bearings)


class VerticalSegments(Value):
    """Pieces of upright lines between two edges, with what they look like (Goedeme et al. 2007, section 3.3).

    `azimuths` (N,): radians, counter-clockwise from forward. `elevations` (N, 2): of the upper and the lower end
    (radians above the horizon). `descriptors` (N, 10) float32: three colour correlations, seven coefficients of the
    intensity profile from the upper end down. `weights` (N,): how many neighbouring segments each stands for.
    `points` (N, 2, 2): columns and rows of both ends (pixels) in the image they were found in.
    """

    azimuths: Annotated[Array, Shape("N")]
    elevations: Annotated[Array, Shape("N", 2)]
    descriptors: Annotated[Floats, Shape("N", 10)]
    weights: Annotated[Floats, Shape("N"), Bounds(ge=0)]
    points: Annotated[Array, Shape("N", 2, 2, finite=False)]

    def __len__(self) -> int:
        return len(self.azimuths)

    def chosen(self, rows: npt.NDArray[np.int64] | slice) -> "VerticalSegments":
        """Some of them."""
        return VerticalSegments(
            self.azimuths[rows], self.elevations[rows], self.descriptors[rows], self.weights[rows], self.points[rows]
        )

    def bearings(self) -> Array:
        """Unit vectors in the robot's frame of both ends: (N, 2, 3)."""
        level = np.cos(self.elevations)
        around = self.azimuths[:, None]
        return np.stack([level * np.cos(around), level * np.sin(around), np.sin(self.elevations)], axis=-1)


class GlobalDescriptor(Value):
    """The colours of a whole view. `values` (3,) float32: correlations as in `LocalFeatures`, over all of it."""

    values: Annotated[Floats, Shape(3)]


def view_features(features: LocalFeatures | None, segments: VerticalSegments | None) -> ViewFeatures:
    """A view prepared for comparison with others."""
    return ViewFeatures(
        None if features is None else features.patches(),
        None if segments is None else Segments(segments.descriptors, segments.azimuths),
    )
