"""Builds an index of a map's references by appearance."""

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import ReferenceIndex

from .exact_search import short_vectors
from .inverted_file import build, faiss_or_none

MIN_REFERENCES = 1000
"""Smallest map that gets an index, references."""
REBUILD_GROWTH = 2.0
"""Growth of a map, as a factor, at which its index is rebuilt."""
DIMENSIONS = 128
"""Numbers that are kept of each reference."""
EXACT_UP_TO = 30_000
"""References of a map up to which the short vectors of all are compared: 10 ms at 36 headings."""


class BuildReferenceIndexState(State):
    """Number of references that the index was built from."""

    references: int = 0


class BuildReferenceIndex(Stage):
    """Builds an index that finds the references similar to a view, at any heading, without comparing them all.

    Views become short vectors: the square roots of their histograms, on the principal axes of the map. All are compared
    with the view's; in a map of more than `EXACT_UP_TO` they are in an inverted file, with four bits for each two
    dimensions (faiss; Jégou, Douze & Schmid 2011; `pip install 'omninav[index]'`, without which it takes longer). The
    index of a finished map is kept in the cache. That of a map that grows is rebuilt when the map has grown by
    `REBUILD_GROWTH`; until then references are appended to it.
    """

    class Out(Outputs):
        """The index; absent for a small map."""

        index: ReferenceIndex | None = None

    def setup(self, ctx: Context) -> None:
        self._index: ReferenceIndex | None = None
        self._map: ReferenceGraph | None = None

    def step(self, ctx: Context, map: ReferenceGraph, state: BuildReferenceIndexState) -> Out:
        if len(map) < MIN_REFERENCES:
            return self.Out()
        if len(map) >= REBUILD_GROWTH * state.references:
            state.references, self._index = len(map), None
        if self._index is None or map is not self._map:
            ctx.status("indexing the map's references")
            self._index, self._map = self._built(ctx, map, state.references), map
        return self.Out(index=self._index)

    def _built(self, ctx: Context, map: ReferenceGraph, references: int) -> ReferenceIndex:
        faiss = faiss_or_none() if references > EXACT_UP_TO else None
        if faiss is not None:
            return build(faiss, map, references, DIMENSIONS, ctx.progress)
        if references > EXACT_UP_TO:
            ctx.warn(
                f"all {references} references are looked through at every image, because faiss is not installed; for "
                "less time type pip install 'omninav[index]'"
            )
        return short_vectors(map, references, DIMENSIONS)
