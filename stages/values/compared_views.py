"""The views of a tour, each two compared: what places are made of."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value
from omninav.stages.geometry.appearance.visual_distance import ComparisonOptions, ViewFeatures

from .local_features import GlobalDescriptor, LocalFeatures, VerticalSegments, view_features
from .pose import PoseSource

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class ComparedViews(Value):
    """N views in the order of the drive, first those of a known map, with their visual distances.

    `features`, `segments` (None: not looked for) and `descriptors`: one entry for each view. `poses` (N, 3): x, y (m),
    heading (rad), from `pose_source`: for scoring and drawing only. `frames` (N,): their numbers among all images;
    `orders` (N,): among the views, with a gap from tour to tour. `tours` (N,): which tour each is from, 0 for a known
    map. `owners` (N,): their place in the known map, -1 for new ones.

    `distances` (N, N): visual distances, inf where two views have nothing in common. `shares` (N, N): of the features,
    how many match. `options`: the ratios of patches and segments, the largest colour distance, the least number of
    matches and the smallest mean angle (rad) by which they were compared.
    """

    features: tuple[LocalFeatures, ...]
    segments: tuple[VerticalSegments | None, ...]
    descriptors: tuple[GlobalDescriptor, ...]
    poses: Array
    pose_source: PoseSource
    frames: Ints
    orders: Ints
    tours: Ints
    owners: Ints
    distances: Array
    shares: Array
    options: tuple[float, float, float, int, float]

    def __len__(self) -> int:
        return len(self.features)

    def view_features(self, view: int) -> ViewFeatures:
        """A view prepared for comparison with others."""
        return view_features(self.features[view], self.segments[view])

    def comparison_options(self) -> ComparisonOptions:
        """How the views were compared."""
        ratio, segment_ratio, max_colour_distance, min_matches, min_angle = self.options
        return ComparisonOptions(
            ratio, segment_ratio, max_colour_distance, min_matches=min_matches, min_angle=min_angle
        )
