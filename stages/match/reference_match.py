"""Base of all comparisons of a view with the references of a map."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, State
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.visual_words import WordSimilarities

from .map_calibration import MapCalibration


class LastView(State):
    """The features (segments, bins) of the last view and the tick they are of; None before the first.

    `stages/geometry/landmarks/unbroken_view.py` compares two images by their local features.
    """

    values: Floats | None = None
    index: int = -1

    def similarity(self, ctx: Context, values: Floats, compare: Callable[[Floats], Floats]) -> float | None:
        """Gives the similarity of a view to the one before, at the best heading, and keeps the view in its place.

        `compare`: similarities of the view to another one. None where the tick before had no view, or was of another
        log, and of a view that is not divided around the robot, which changes as the robot turns.
        """
        follows = ctx.tick.index == self.index + 1 and not ctx.tick.first_of_log
        before, self.values, self.index = self.values if follows else None, values, ctx.tick.index
        if before is None or before.shape != values.shape or len(values) < 2:
            return None
        return float(compare(before).max())


@dataclass(kw_only=True, eq=False)
class ReferenceMatch(ABC):
    """Compares a view with a map's references at all headings: a mixin, beside `Stage`.

    Without `candidates` all references are compared. Where `words` are given, the similarity by visual words, which is
    the same at all headings, is a factor of each reference's.
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which each reference is compared, evenly spaced over the circle."""
    word_power: Annotated[float, Bounds(ge=0)] = 0.0
    """Exponent of the similarity by visual words (`candidates=words`); 0: words only choose candidates. At 0.25 the
    most similar image is nearer on average, yet a filter tracks worse (docs/experiments/words.md)."""

    class Out(Outputs):
        """Similarities of view and references, and their calibration (the likelihood ratio of the right place), which
        is absent for small maps."""

        similarities: Similarities
        calibration: SimilarityCalibration | None = None

    def __post_init__(self) -> None:
        self._calibration = MapCalibration()

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        map: ReferenceGraph,
        candidates: Candidates | None = None,
        words: WordSimilarities | None = None,
        length_scale: LengthScale | None = None,
        last: LastView | None = None,
    ) -> Out:
        """Compare one view; `length_scale` is for the calibration only, which knows no `words`."""
        check_same_kind(features, map)
        candidates = candidates or Candidates()
        values = self.compare(map, features, candidates.references)
        if words is not None and self.word_power:
            values = values * words.factors(len(map), candidates.references, self.word_power)[:, None]
        how = candidates.references, candidates.sampling_weight, *self.exponent_and_scale(features)
        if not ctx.is_read("calibration"):
            return self.Out(similarities=Similarities(values, *how))

        def of_one(view: Floats) -> Floats:
            return self.compare_view(map, features, view)

        def of_view(view: int, chosen: Ints) -> Floats:
            return self.compare(map, replace(features, values=np.asarray(map.features[view])), chosen)

        weighed = words is not None and self.word_power > 0.0  # the last view has no similarity by words
        of_last = None if weighed or last is None else last.similarity(ctx, features.values, of_one)
        similarities = Similarities(values, *how, of_last)
        return self.Out(similarities=similarities, calibration=self._calibration.of(ctx, map, of_view, length_scale))

    @abstractmethod
    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        """Similarities to the chosen references, None for all: (chosen, headings)."""

    def compare_view(self, map: ReferenceGraph, features: SegmentFeatures, view: Floats) -> Floats:
        """Similarities to one more view (segments, bins), as if it were a reference of the map: (1, headings)."""
        one = ReferenceGraph(np.zeros((1, 3)), view[None], features.kind, np.empty((0, 2), np.int64), "truth")
        return self.compare(one, features, None)

    def exponent_and_scale(self, features: SegmentFeatures) -> tuple[float | None, float | None]:
        """Gives `exponent` and `colour_scale` of the `Similarities`, for stages that compare as this match does.

        (None, None): they cannot, and `sensor=expected_observation` refuses the match.
        """
        return None, None


def check_same_kind(features: SegmentFeatures, map: ReferenceGraph) -> None:
    """Raises BadInput where view and map are described by different features."""
    kind = features.kind
    shape = tuple(map.features.shape[1:])
    if len(map) and (map.kind != kind or shape != features.values.shape):
        raise BadInput(
            f"map: its views are {map.kind} of {shape[0]} segments x {shape[1]} bins, the current one is {kind} of "
            f"{features.values.shape[0]} x {features.values.shape[1]}; learn the map again with these features"
        )
