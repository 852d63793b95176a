"""Selects the references that look like the view, by an index of all, and those near the belief."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.segments import turned_views
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import ReferenceIndex

from .appearance_vectors import appearance_vectors
from .background import with_even_background
from .inverted_file import InvertedFile, faiss_or_none
from .near_belief import NearBelief


class IndexedCandidates(NearBelief):
    """Selects the references most similar to the view anywhere in the map, and those near the belief.

    For maps that are too large to be compared whole. Without a belief, and where it is spread so widely that more than
    `global_references` are near it, those come from the index alone. A belief in one place is looked after as in
    `near_belief`, and the index adds a few, so that a kidnapped robot is found: the view is looked up at every other
    heading, the others at the next image. Without such a belief it is looked up at all headings;
    the background is the same at each image, since it has not to find anything.
    Small maps are compared whole; without an index (port `index`) the rule is that of `near_belief`.
    """

    background_references: Annotated[int, Bounds(ge=0)] = 128
    """References compared of all others, the same at each image."""
    global_references: Annotated[int, Bounds(ge=1)] = 4800
    """References from the index where it is not known where the robot is."""
    recovery_references: Annotated[int, Bounds(ge=0)] = 16
    """References from the index where it is, in case it was kidnapped."""
    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which the view is looked up."""
    lists: Annotated[int, Bounds(ge=1)] = 64
    """Lists of similar references that are searched for each heading without a belief."""
    recovery_lists: Annotated[int, Bounds(ge=1)] = 4
    """The same with one."""

    def setup(self, ctx: Context) -> None:
        """Forget the index of an earlier map."""
        super().setup(ctx)
        self._file: InvertedFile | None = None

    def step(  # type: ignore[override]
        self,
        ctx: Context,
        features: SegmentFeatures,
        map: ReferenceGraph,
        index: ReferenceIndex | None = None,
        near: Particles | None = None,
        length_scale: LengthScale | None = None,
    ) -> NearBelief.Out:
        """Select the references for one view."""
        file = self._ready(index, map) if index is not None and len(map) > self.compare_all_up_to else None
        if file is None:
            return super().step(ctx, map, near, length_scale)
        around = np.empty(0, np.int64) if near is None else self._around(map, near, length_scale)
        known = 0 < len(around) <= self.global_references
        number, lists = self._effort(known)
        if number:
            turned = self._turned(features, map)
            found = file.nearest(turned[ctx.tick.index % 2 :: 2] if known else turned, number, lists)
            around = distinct(np.concatenate([around, found])) if known else found
        return self.Out(candidates=with_even_background(around, len(map), self.background_references))

    def _effort(self, known: bool) -> tuple[int, int]:
        if known:
            return self.recovery_references, self.recovery_lists
        return self.global_references, self.lists

    def _turned(self, features: SegmentFeatures, map: ReferenceGraph) -> npt.NDArray[np.float32]:
        windows = isinstance(features, SegmentHistograms) and features.directions is not None
        views = features.values[:, None] if windows else turned_views(features.values, self.headings)
        if views.shape[1:] != map.features.shape[1:]:
            raise BadInput(
                f"map: its views are of {map.features.shape[1]} segments x {map.features.shape[2]} bins, the current "
                f"one of {views.shape[1]} x {views.shape[2]}; learn the map again with these features"
            )
        return appearance_vectors(views, map.kind)

    def _ready(self, index: ReferenceIndex, map: ReferenceGraph) -> InvertedFile | None:
        faiss = faiss_or_none()
        if faiss is None:
            return None
        if self._file is None or self._file.index is not index:
            if len(index) > len(map) or len(index.mean) != map.features.shape[1] * map.features.shape[2]:
                raise BadInput("candidates: this index is of another map; wire reference_index.map to the same one")
            self._file = InvertedFile(faiss, index)
        self._file.append(map)
        return self._file
