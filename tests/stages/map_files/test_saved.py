"""Maps in files, and what is said of one that was made of others."""

from pathlib import Path

import numpy as np
import pytest
from small_run import reference_graph

from omninav.pipeline import BadInput
from omninav.pipeline.engine.artifact import artifact_digest, read_header, write_artifact
from omninav.stages.map_files.point_cloud import ply
from omninav.stages.map_files.saved import read_saved, refuse_other_views, target, write_saved


def test_a_map_made_of_others_says_what_their_files_agree_on_and_which_they_were(tmp_path: Path) -> None:
    files = [str(tmp_path / f"{name}.omap") for name in ("one", "other")]
    for bins, file in enumerate(files):
        stages = {"unwarp": {"width": 90}, "features": {"bins": bins, "segments": 3}, "drift": {"sigma": bins}}
        write_artifact(Path(file), reference_graph(3 + bins), {"variant": "mine", "file": file, "stages": stages})
    sources = read_saved(files, 2, 2)
    assert [len(source.map) for source in sources] == [3, 4]
    write_saved(tmp_path / "both.omap", sources[1].map, sources, "map join")
    assert read_header(tmp_path / "both.omap")["facts"] == {
        "variant": "mine",
        "stages": {"unwarp": {"width": 90}},
        "made_of": [{"file": Path(file).name, "sha256": artifact_digest(Path(file))} for file in files],
        "made_by": "map join",
    }
    with pytest.raises(BadInput, match=r"other\.omap: .*other features than .*one\.omap's \(bins=1 and 0\)"):
        refuse_other_views(sources)
    both = read_saved(str(tmp_path / "both.omap"))
    refuse_other_views([*both, sources[0], *both])  # it says nothing of its features
    assert target(str(tmp_path / "new.omap"), sources) == tmp_path / "new.omap"
    assert target(str(tmp_path / "both.omap"), sources) == tmp_path / "both.omap"
    for wrong, said, read in (
        ("new.zip", "ends in .omap", sources),
        ("other.omap", "this map is read", sources),
        ("other.omap", "it is there, and was not made of other maps", sources[:1]),
    ):
        with pytest.raises(BadInput, match=said):
            target(str(tmp_path / wrong), read)


@pytest.mark.parametrize(
    ("given", "how", "said"),
    [
        (None, {}, "0 files are given, expected at least 1 map;"),
        ("a", {"at_least": 2}, "1 files are given, expected at least 2 maps;"),
        (["a", "b"], {"at_most": 1}, "2 files are given, expected 1 map;"),
    ],
)
def test_too_few_or_too_many_maps_are_counted(given: list[str] | None, how: dict[str, int], said: str) -> None:
    with pytest.raises(BadInput, match=f"maps: {said}"):
        read_saved(given, **how)


def test_points_follow_a_header_that_counts_them() -> None:
    header, _, points = ply(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])).partition(b"end_header\n")
    assert b"element vertex 2\n" in header
    assert np.frombuffer(points, "<f8").tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
