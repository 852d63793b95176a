"""Maps of references, joined, thinned and cut."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_run import reference_graph

from omninav.pipeline import BadInput, StoredRows
from omninav.pipeline.engine import chunks
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.map_files.references import cut_references, joined_references, keepers, thinned_references
from omninav.stages.values.maps import ReferenceGraph


def line(count: int, step: float, segments: int = 4) -> ReferenceGraph:
    """References along x, each joined with the next."""
    poses = np.zeros((count, 3))
    poses[:, 0] = step * np.arange(count)
    features = np.arange(count * segments * 2, dtype=np.float32).reshape(count, segments, 2)
    edges = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    return ReferenceGraph(poses, features, "colours", edges, "truth")


def test_a_joined_map_holds_the_references_and_edges_of_both() -> None:
    one, other = reference_graph(6), reference_graph(9)
    both = joined_references([one, other], "truth")
    assert len(both) == 15
    assert np.array_equal(both.features, np.concatenate([one.features, other.features]))
    assert np.array_equal(both.edges, [*one.edges.tolist(), *(other.edges + 6).tolist()])
    assert both.edges.dtype == np.int64


def test_an_empty_map_joins_with_any() -> None:
    assert len(joined_references([ReferenceGraph.empty(), line(3, 1.0)], "truth")) == 3
    assert not len(joined_references([ReferenceGraph.empty(), ReferenceGraph.empty()], "truth"))


def test_maps_of_other_features_do_not_join() -> None:
    with pytest.raises(
        BadInput, match="map 2: its views are colours of 4 segments x 2 bins, those of the first are hist"
    ):
        joined_references([reference_graph(3), line(3, 1.0)], "truth")


def test_thinned_references_are_apart_and_stay_joined_along_the_drive() -> None:
    whole = line(21, 0.1)
    thin = thinned_references(replace(whole, edges=whole.edges[:, ::-1].copy()), 0.45)
    assert np.allclose(thin.poses[:, 0], [0.0, 0.5, 1.0, 1.5, 2.0])
    assert thin.edges.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert np.array_equal(thin.features, whole.features[::5])


def test_every_reference_has_a_kept_one_nearby_and_kept_ones_are_apart() -> None:
    poses = np.random.default_rng(3).uniform(0, 5, (400, 3))
    keeper = keepers(poses, 0.6, math.pi)
    kept = poses[np.unique(keeper), :2]
    gaps = np.hypot(*(kept[:, None] - kept[None]).transpose(2, 0, 1)) + 9.0 * np.eye(len(kept))
    assert gaps.min() > 0.6
    assert np.hypot(*(poses - poses[keeper]).T[:2]).max() <= 0.6
    assert (keeper[keeper] == keeper).all()


def test_views_in_other_directions_do_not_stand_for_each_other() -> None:
    map = line(8, 0.0, segments=1)  # all at one spot
    map.poses[:, 2] = np.repeat([0.0, 1.5, 3.0, -1.5], 2)
    assert thinned_references(map, 1.0).poses[:, 2].tolist() == [0.0, 1.5, 3.0, -1.5]
    around = line(8, 0.0)
    around.poses[:, 2] = map.poses[:, 2]
    assert len(thinned_references(around, 1.0)) == 1


def test_a_cut_map_keeps_the_edges_inside() -> None:
    cut = cut_references(line(6, 1.0), np.array([0, 1, 1, 0, 1, 1], bool))
    assert cut.poses[:, 0].tolist() == [1.0, 2.0, 4.0, 5.0]
    assert cut.edges.tolist() == [[0, 1], [2, 3]]


def test_maps_that_stay_in_their_files_give_what_those_in_memory_give(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chunks, "IN_MEMORY", 0)
    known = [reference_graph(40), reference_graph(25)]
    for number, map in enumerate(known):
        write_artifact(tmp_path / f"{number}.omap", map)
    stored = [read_artifact(tmp_path / f"{number}.omap") for number in range(2)]
    for one, other in (
        (joined_references(known, "truth"), joined_references(stored, "truth")),  # type: ignore[arg-type]
        (thinned_references(known[0], 1.0), thinned_references(stored[0], 1.0)),  # type: ignore[arg-type]
    ):
        assert isinstance(other.features, StoredRows)
        assert np.array_equal(one.features, other.features[:])
        assert np.array_equal(one.features[3, 1:], other.features[3, 1:])
        write_artifact(tmp_path / "one.omap", one)
        write_artifact(tmp_path / "other.omap", other)
        assert (tmp_path / "one.omap").read_bytes() == (tmp_path / "other.omap").read_bytes()
