"""A reference graph in its file, and in memory once it grows."""

from pathlib import Path

import numpy as np
import pytest
from small_run import reference_graph

from omninav.pipeline import StoredRows
from omninav.pipeline.engine import chunks
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.values.map_places import map_poses
from omninav.stages.values.maps import ReferenceGraph, within
from omninav.stages.values.pose import Pose


def test_a_map_in_its_file_is_in_memory_once_it_grows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "IN_MEMORY", 0)
    known = reference_graph(40)
    write_artifact(tmp_path / "map.omap", known)
    map = read_artifact(tmp_path / "map.omap")
    assert isinstance(map, ReferenceGraph)
    assert isinstance(map.features, StoredRows)
    assert "read where it is needed" in repr(map)
    assert np.array_equal(decode(encode(map)).features, known.features)
    for _ in range(2):
        map.insert(Pose(0.0, 0.0, 0.0), known.features[3], known.kind)
    assert isinstance(map.features, np.ndarray)
    assert np.array_equal(map.features, np.concatenate([known.features, known.features[[3, 3]]]))
    write_artifact(tmp_path / "grown.omap", map)
    assert len(read_artifact(tmp_path / "grown.omap")) == 42  # type: ignore[arg-type]


def test_a_new_map_is_of_the_kind_of_its_first_view_and_keeps_each_edge_once() -> None:
    map, view = ReferenceGraph.empty(), np.ones((4, 5), np.float32)
    assert map_poses(None).shape == map_poses(map).shape == (0, 3)
    rows = [map.insert(Pose(float(at), 2.0, 3.0), at * view, "descriptors") for at in range(3)]
    assert (rows, len(map), map.kind, map.features.shape) == ([0, 1, 2], 3, "descriptors", (3, 4, 5))
    assert map_poses(map).tolist() == [[0.0, 2.0, 3.0], [1.0, 2.0, 3.0], [2.0, 2.0, 3.0]]
    assert [map.join(*ends) for ends in ((2, 0), (0, 2), (1, 1), (0, 1), (1, 2))] == [True, False, False, True, True]
    assert map.edges.tolist() == [[0, 2], [0, 1], [1, 2]]
    for other, kind in ((view[:, :4], "descriptors"), (view, "colours")):
        with pytest.raises(ValueError, match=r"in a map of descriptors \(4, 5\)"):
            map.insert(Pose(0.0, 0.0, 0.0), other, kind)


def test_poses_within_a_circle_are_named_from_the_nearest_on() -> None:
    poses = np.array([[3.0, 4.0, 0.0], [0.0, 1.0, 9.0], [3.1, 4.0, 0.0], [1.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    assert within(poses, 0.0, 0.0, 5.0).tolist() == [4, 1, 3, 0]
    assert within(poses, 3.1, 4.0, 0.5).tolist() == [2, 0]
