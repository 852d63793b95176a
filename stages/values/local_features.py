"""Local features of a view: patches, vertical segments, and a global descriptor."""

from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.appearance.visual_distance import Patches, Segments, ViewFeatures
from omninav.stages.geometry.arrays import Array, Bytes, Floats, Ints


class VerticalSegments(Value):
    """Pieces of upright lines between two edges, with what they look like (Goedeme et al. 2007, section 3.3).

    `azimuths` (N,): radians, counter-clockwise from forward. `elevations` (N, 2): of the upper and the lower end
    (radians above the horizon). `descriptors` (N, 10) float32: three colour correlations, seven cosine coefficients of
    the intensity profile (grey levels) from the upper end down. `weights` (N,): how many neighbouring segments each
    means. `points` (N, 2, 2): columns and rows of both ends (pixels) in the image they were found in.
    """

    azimuths: Annotated[Array, Shape("N")]
    elevations: Annotated[Array, Shape("N", 2)]
    descriptors: Annotated[Floats, Shape("N", 10)]
    weights: Annotated[Floats, Shape("N"), Bounds(ge=0)]
    points: Annotated[Array, Shape("N", 2, 2, finite=False)]

    def __len__(self) -> int:
        return len(self.azimuths)

    def chosen(self, rows: Ints | slice) -> "VerticalSegments":
        """Some of them."""
        return VerticalSegments(
            self.azimuths[rows], self.elevations[rows], self.descriptors[rows], self.weights[rows], self.points[rows]
        )

    def bearings(self) -> Array:
        """Unit vectors in the robot's frame of both ends: (N, 2, 3)."""
        level = np.cos(self.elevations)
        around = self.azimuths[:, None]
        return np.stack([level * np.cos(around), level * np.sin(around), np.sin(self.elevations)], axis=-1)


NO_SEGMENTS = VerticalSegments(
    np.empty(0), np.empty((0, 2)), np.empty((0, 10), np.float32), np.empty(0, np.float32), np.empty((0, 2, 2))
)


class LocalFeatures(Value):
    """Patches of a view with what they look like, the strongest first, and its columns where they were looked for.

    `bearings` (N, 3): unit vectors in the robot's frame, from the camera's projection centre. `points` (N, 2): columns
    and rows (pixels, integers are centres) in the image they were found in. `descriptors` (N, D) uint8, compared by
    Euclidean distance. `colours` (N, 3) float32: correlations of red with green, red with blue, green with blue over
    the patch, in [-1, 1] (Goedeme et al. 2007, equation 1; erratum 25 in docs/papers.md). `sizes` (N,): diameters
    (pixels). `columns`: the second kind of features (section 3.3); None: not looked for. `mirrored`: the image showed
    the world mirrored, which `mirrored_sift` undoes.
    """

    bearings: Annotated[Array, Shape("N", 3), Bounds(ge=-1.001, le=1.001)]
    points: Annotated[Array, Shape("N", 2, finite=False)]
    descriptors: Annotated[Bytes, Shape("N", "D")]
    colours: Annotated[Floats, Shape("N", 3), Bounds(ge=-1.001, le=1.001)]
    sizes: Annotated[Floats, Shape("N"), Bounds(ge=0)]
    columns: VerticalSegments | None = None
    mirrored: bool = False

    def __len__(self) -> int:
        return len(self.bearings)

    def chosen(self, rows: Ints | slice) -> "LocalFeatures":
        """Some of the patches, and all columns."""
        return replace(
            self,
            bearings=self.bearings[rows],
            points=self.points[rows],
            descriptors=self.descriptors[rows],
            colours=self.colours[rows],
            sizes=self.sizes[rows],
        )

    def patches(self) -> Patches:
        """Vectors that they are matched by."""
        azimuths = np.arctan2(self.bearings[:, 1], self.bearings[:, 0])
        return Patches(self.descriptors.astype(np.float32), self.colours, azimuths)

    def point_bearings(self) -> Array:
        """Bearings (N + 2C, 3) of the patches, then of the upper and the lower end of each of C columns."""
        if self.columns is None:
            return self.bearings
        return np.concatenate([self.bearings, self.columns.bearings().reshape(-1, 3)])

    def point_pixels(self) -> Array:
        """Pixels (N + 2C, 2) of the same."""
        if self.columns is None:
            return self.points
        return np.concatenate([self.points, self.columns.points.reshape(-1, 2)])


class GlobalDescriptor(Value):
    """The colours of a whole view. `values` (3,) float32: correlations as in `LocalFeatures`, over all of it."""

    values: Annotated[Floats, Shape(3)]


def view_features(features: LocalFeatures) -> ViewFeatures:
    """A view prepared for comparison with others."""
    columns = features.columns
    segments = None if columns is None else Segments(columns.descriptors, columns.azimuths)
    return ViewFeatures(features.patches(), segments)
