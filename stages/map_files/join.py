"""Joins saved maps."""

from collections.abc import Sequence

from omninav.pipeline import BadInput, Context, Outputs, Stage
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import PoseSource
from omninav.stages.values.topological_map import TopologicalMap

from .places import joined_places
from .references import joined_references
from .saved import MapOfPlaces, SavedMap, read_saved, refuse_other_views, target, write_saved


class JoinMaps(Stage):
    """Writes one map of the references, or places, of several.

    All must be of one kind, with views made in the same way, and their poses in one frame. No edge or link is added
    between them. Raises BadInput where a map does not fit the first.
    """

    maps: str | tuple[str, ...] | None = None
    """The maps (.omap), at least two."""
    same_frame: bool = False
    """States that the poses of all maps are in one frame. It need not be said of poses from ground truth; poses from
    odometry start again with every tour."""
    out: str = "joined.omap"
    """The file to write."""

    class Out(Outputs):
        """Nothing: it writes a file."""

    def step(self, ctx: Context) -> Out:
        """Join the maps."""
        sources = read_saved(self.maps, at_least=2)
        path = target(self.out, sources)
        refuse_other_views(sources)
        map = joined([source.map for source in sources], self._pose_source(sources))
        write_saved(path, map, sources, "join")
        what = "references" if isinstance(map, ReferenceGraph) else "places"
        print(f"{path}: {len(map)} {what} of {len(sources)} maps ({' + '.join(str(len(one.map)) for one in sources)})")
        return self.Out()

    def _pose_source(self, sources: Sequence[SavedMap]) -> PoseSource:
        given: list[PoseSource] = [source.map.pose_source for source in sources]
        if set(given) == {"truth"}:
            return "truth"
        if not self.same_frame:
            own = next(source for source in sources if source.map.pose_source != "truth")
            raise BadInput(
                f"{own.path}: its poses are from {own.map.pose_source}, whose frame may not be that of the other maps; "
                "type same_frame=true if it is"
            )
        return next(source for source in given if source != "truth")


def joined(maps: Sequence[MapOfPlaces], pose_source: PoseSource) -> MapOfPlaces:
    """One map of several of a kind. Raises BadInput where they are of two kinds, or their features differ."""
    graphs = [map for map in maps if isinstance(map, ReferenceGraph)]
    topological = [map for map in maps if isinstance(map, TopologicalMap)]
    if graphs and topological:
        raise BadInput("maps: a ReferenceGraph and a TopologicalMap are given; maps of one kind can be joined")
    return joined_references(graphs, pose_source) if graphs else joined_places(topological, pose_source)
