"""Selects the references that look like the view, anywhere in the map, and those near the belief."""

import numpy as np

from omninav.pipeline import BadInput, Context, Stage
from omninav.stages.geometry.appearance.segments import HEADINGS, turned_views
from omninav.stages.geometry.arrays import Floats
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import InvertedLists, ReferenceIndex, ShortVectors

from .appearance_vectors import appearance_vectors
from .around_belief import AroundBelief
from .exact_search import ExactSearch
from .inverted_file import InvertedFile, faiss_or_none

LISTS = 64
"""Lists of similar references that are searched in a large map for each heading, without a belief."""
SIMILAR_LISTS = 4
"""The same number with a belief."""
SIMILAR_REFERENCES = 128
"""References from the index beside those near the belief."""
GLOBAL_REFERENCES = 4800
"""References from the index where it is not known where the robot is."""


class IndexedCandidates(AroundBelief, Stage):
    """Selects the references most similar to the view anywhere in the map, and those near the belief.

    For maps that would take long to be compared whole. The index is asked with the view at all headings. Where the
    belief is near few references, these are compared, and a few more from the index, so that a robot whose belief is
    wrong is found, and known to be lost. Without a belief, and where it is spread so widely that more than
    `GLOBAL_REFERENCES` are near it, those come from the index alone. Small maps are compared whole. Defaults:
    docs/scaling.md.
    """

    def setup(self, ctx: Context) -> None:
        super().setup(ctx)
        self._search: ExactSearch | InvertedFile | None = None

    def step(
        self,
        ctx: Context,
        features: SegmentFeatures,
        map: ReferenceGraph,
        index: ReferenceIndex | None = None,
        near: Particles | None = None,
        length_scale: LengthScale | None = None,
    ) -> AroundBelief.Out:
        if index is None or len(map) <= self.compare_all_up_to:
            return self.Out(candidates=Candidates())
        search, turned = self._ready(index, map), self._turned(features, map)
        around = self.around(map, near, length_scale)
        known = 0 < len(around) <= GLOBAL_REFERENCES
        asked = (SIMILAR_REFERENCES, SIMILAR_LISTS) if known else (GLOBAL_REFERENCES, LISTS)
        similar = search.nearest(turned, *asked)
        chosen = distinct(np.concatenate([around, similar])) if known else similar
        return self.Out(candidates=self.with_others(chosen, map))

    def _turned(self, features: SegmentFeatures, map: ReferenceGraph) -> Floats:
        windows = isinstance(features, SegmentHistograms) and features.directions is not None
        views = features.values[:, None] if windows else turned_views(features.values, HEADINGS)
        if views.shape[1:] != map.features.shape[1:]:
            raise BadInput(
                f"map: its views are of {map.features.shape[1]} segments x {map.features.shape[2]} bins, the current "
                f"one of {views.shape[1]} x {views.shape[2]}; learn the map again with these features"
            )
        return appearance_vectors(views, map.kind)

    def _ready(self, index: ReferenceIndex, map: ReferenceGraph) -> ExactSearch | InvertedFile:
        if self._search is None or self._search.index is not index:
            if len(index) > len(map) or len(index.mean) != map.features.shape[1] * map.features.shape[2]:
                raise BadInput("candidates: this index is of another map; wire reference_index.map to the same one")
            self._search = search_in(index)
        self._search.append(map)
        return self._search


def search_in(index: ReferenceIndex) -> ExactSearch | InvertedFile:
    """An index made ready to be asked. Raises BadInput where it needs faiss, and that is not installed."""
    if isinstance(index, ShortVectors):
        return ExactSearch(index)
    assert isinstance(index, InvertedLists)
    faiss = faiss_or_none()
    if faiss is None:
        raise BadInput(
            "candidates: this index was built with faiss, which is not installed; pip install 'omninav[index]'"
        )
    return InvertedFile(faiss, index)
