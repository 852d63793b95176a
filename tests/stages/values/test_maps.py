"""A reference graph in its file, and in memory once it grows."""

from pathlib import Path

import numpy as np
import pytest
from small_run import reference_graph

from omninav.pipeline import StoredRows
from omninav.pipeline.engine import chunks
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.values.maps import ReferenceGraph
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
