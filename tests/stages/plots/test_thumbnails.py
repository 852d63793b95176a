"""Which images become thumbnails, in which order."""

import itertools

import numpy as np
import pytest
from made_places import made_map

from omninav.pipeline import Context
from omninav.stages.plots.thumbnails import (
    CollectThumbnails,
    ReferenceSnapshot,
    ReferenceThumbnails,
    ThumbnailsState,
    ViewThumbnails,
    joined,
)
from omninav.stages.values.image import Panorama, Windows
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.thumbnails import Thumbnails, decoded

CTX = Context("thumbnails")


def grey(level: int, columns: int = 40) -> np.ndarray:
    return np.full((20, columns, 3), level, np.uint8)


def levels(jpegs: tuple[bytes, ...]) -> list[int]:
    return [round(float(decoded(jpeg).mean())) for jpeg in jpegs]


def test_an_image_becomes_a_thumbnail_where_the_map_has_grown() -> None:
    map, state, stage, found = ReferenceGraph.empty(), ThumbnailsState(), ReferenceSnapshot(columns=20), []
    for level, grows in ((40, True), (80, False), (120, True)):
        if grows:
            map.insert(Pose(0.0, 0.0, 0.0), np.ones((1, 1), np.float32), "histograms")
        found.append(stage.step(CTX, Panorama(grey(level)), map, state).snapshots)
    assert [None if each is None else levels(each.jpegs) for each in found] == [[40], None, [120]]
    assert decoded(found[0].jpegs[0]).shape == (10, 20, 3)


def test_each_window_that_became_a_reference_is_one() -> None:
    map, state = ReferenceGraph.empty(), ThumbnailsState()
    seen = Windows(np.stack([grey(level) for level in (10, 20, 30)]), np.zeros(3), 1.0)
    for _ in range(2):
        map.insert(Pose(0.0, 0.0, 0.0), np.ones((1, 1), np.float32), "histograms")
    stage = ReferenceSnapshot(columns=20)
    snapshots = stage.step(CTX, seen, map, state).snapshots
    assert snapshots is not None
    assert levels(snapshots.jpegs) == [10, 20]
    assert decoded(snapshots.jpegs[0]).shape == (10, 20, 3)
    assert state.references == 2
    assert stage.step(CTX, seen, map, state).snapshots is None
    map.insert(Pose(0.0, 0.0, 0.0), np.ones((1, 1), np.float32), "histograms")
    third = stage.step(CTX, seen, map, state).snapshots
    assert third is not None
    assert levels(third.jpegs) == [10]


def test_thumbnails_of_a_tour_are_in_the_order_of_its_references() -> None:
    some = [ReferenceThumbnails((b"ab", b"c")), ReferenceThumbnails(()), ReferenceThumbnails((b"def",))]
    thumbnails = CollectThumbnails().step(CTX, some).thumbnails
    assert bytes(thumbnails.jpegs) == b"abcdef"
    assert thumbnails.ends.tolist() == [0, 2, 3, 6]
    assert len(joined([])) == 0


def parts(thumbnails: Thumbnails) -> list[bytes]:
    return [bytes(thumbnails.jpegs[a:b]) for a, b in itertools.pairwise(thumbnails.ends.tolist())]


@pytest.mark.parametrize("grows", [False, True])
def test_a_topological_map_has_those_of_the_frames_that_it_keeps(grows: bool) -> None:
    # The made map keeps frames 0, 10, 20; a known one of two views had frames 0 and 10, so that this tour begins at 11.
    map = made_map([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], {})
    known = made_map([(0.0, 0.0), (1.0, 0.0)], {}) if grows else None
    snapshots = [ReferenceThumbnails((b"%02d" % n,)) for n in range(21)]
    if grows:
        snapshots[9] = ReferenceThumbnails((b"here",))
    else:
        snapshots[10] = None  # type: ignore[call-overload]
    found = ViewThumbnails().step(CTX, snapshots, map, known).thumbnails
    assert parts(found) == ([b"", b"", b"here"] if grows else [b"00", b"", b"20"])
