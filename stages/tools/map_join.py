"""Joins saved maps."""

from collections.abc import Iterator, Sequence

import numpy as np

from omninav.pipeline import BadInput, Context, Tool
from omninav.pipeline.engine.artifact import artifact_digest
from omninav.stages.map_files.aligned import aligned
from omninav.stages.map_files.aligned_by_landmarks import aligned_by_landmarks
from omninav.stages.map_files.places import joined_places
from omninav.stages.map_files.references import joined_references
from omninav.stages.map_files.saved import MapOfPlaces, SavedMap, read_saved, refuse_other_views, target, write_saved
from omninav.stages.values.landmarks import Landmarks
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import PoseSource
from omninav.stages.values.topological_map import TopologicalMap

MAX_OFF_M = 0.5
"""Median distance from where landmarks put a map of true poses, beyond which these are in another frame (m)."""


class JoinMaps(Tool):
    """Writes one map of the references, or places, of several.

    All must be of one kind, with views made in the same way. Maps of references whose poses are in frames of their own
    are moved as a whole to where the landmarks that they share agree, or else aligned by references that look alike,
    which also straightens them (`aligned`). No edge or link is added between maps. Raises BadInput where a map does not
    fit the first or is given twice, and where too little that looks alike joins it to the others.
    """

    example = "a.omap b.omap out=joined.omap"

    maps: str | tuple[str, ...]
    """The maps (.omap), at least two."""
    same_frame: bool = False
    """States that the poses of all maps are in one frame, so that they stay. It is not needed for poses from ground
    truth; those from odometry start again with every tour, and are aligned by what looks alike."""
    out: str = "joined.omap"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        sources = read_saved(self.maps, at_least=2)
        path = target(self.out, sources)
        refuse_other_views(sources)
        digests = [artifact_digest(source.path) for source in sources]
        if again := next((source for n, source in enumerate(sources) if digests[n] in digests[:n]), None):
            raise BadInput(f"{again.path}: this map is given twice, here or under another name; name each map once")
        given: list[PoseSource] = [source.map.pose_source for source in sources]
        frame: PoseSource = next((source for source in given if source != "truth"), "truth")
        if "truth" in given and frame != "truth" and (self.same_frame or given[0] == "truth"):
            frame = "estimate"  # measured poses, brought into the frame of true ones
        map = joined([source.map for source in sources], frame)
        if not self.same_frame:
            map = _in_one_frame(sources, map, ctx.rng) if frame != "truth" else _checked(sources, map, ctx.rng)
        write_saved(path, map, sources, "join")
        what = "references" if isinstance(map, ReferenceGraph) else "places"
        print(f"{path}: {len(map)} {what} of {len(sources)} maps ({' + '.join(str(len(one.map)) for one in sources)})")
        if isinstance(map, ReferenceGraph) and map.landmarks is not None:
            print(f"landmarks: {', '.join(_of_landmarks(sources, map.landmarks))}")


def _of_landmarks(sources: Sequence[SavedMap], landmarks: Landmarks) -> Iterator[str]:
    """The number of landmarks, what became of their words, and which maps have none, in words."""
    yield f"{len(landmarks)}"
    graphs = [(source.path, source.map) for source in sources if isinstance(source.map, ReferenceGraph)]
    given = [map.landmarks for _, map in graphs if map.landmarks is not None]
    if not all(np.array_equal(each.words.centres, landmarks.words.centres) for each in given):
        yield "with visual words learned from all of them"
    if without := [str(path) for path, map in graphs if map.landmarks is None]:
        yield f"none from {' and '.join(without)}, where images are compared as a whole"


def _in_one_frame(sources: Sequence[SavedMap], map: MapOfPlaces, rng: np.random.Generator) -> MapOfPlaces:
    """The joined map with the poses of all in the frame of the first. Raises BadInput where nothing tells them."""
    found, by = None, "landmarks that are in several maps"
    if isinstance(map, ReferenceGraph):
        graphs = [source.map for source in sources if isinstance(source.map, ReferenceGraph)]
        found = aligned_by_landmarks(graphs, rng)
        if found is None:
            found, by = aligned(graphs), "pairs of references that look alike"
    left = [source for source, fits in zip(sources, found.joined, strict=True) if not fits] if found else sources[1:]
    if found is None or left:
        raise BadInput(
            f"{left[0].path}: its poses are from {left[0].map.pose_source}, whose frame may not be that of the other "
            "maps, and too little in it looks like them to tell; type same_frame=true if it is"
        )
    assert isinstance(map, ReferenceGraph)
    moved = np.hypot(*(found.poses - map.poses)[:, :2].T)
    print(f"aligned by {found.closures} {by}; moved by {moved.max():.2f} m at most")
    return map.moved(found.poses)


def _checked(sources: Sequence[SavedMap], map: MapOfPlaces, rng: np.random.Generator) -> MapOfPlaces:
    """The joined map of true poses. Raises BadInput where landmarks that maps share put one elsewhere."""
    graphs = [source.map for source in sources if isinstance(source.map, ReferenceGraph)]
    found = aligned_by_landmarks(graphs, rng) if graphs else None
    if found is None:
        return map
    first = 0
    for source, graph in zip(sources, graphs, strict=True):
        moved = np.hypot(*(found.poses[first : first + len(graph)] - graph.poses)[:, :2].T)
        first += len(graph)
        if np.median(moved) > MAX_OFF_M:
            raise BadInput(
                f"{source.path}: by landmarks that it shares with the other maps it is {np.median(moved):.2f} m from "
                f"where its true poses have it: is its ground truth in the frame of {sources[0].path}? Type "
                "same_frame=true to join them as they are"
            )
    return map


def joined(maps: Sequence[MapOfPlaces], pose_source: PoseSource) -> MapOfPlaces:
    """One map of several of a kind. Raises BadInput where they are of two kinds, or their features differ."""
    graphs = [map for map in maps if isinstance(map, ReferenceGraph)]
    topological = [map for map in maps if isinstance(map, TopologicalMap)]
    if graphs and topological:
        raise BadInput("maps: a ReferenceGraph and a TopologicalMap are given; maps of one kind can be joined")
    return joined_references(graphs, pose_source) if graphs else joined_places(topological, pose_source)
