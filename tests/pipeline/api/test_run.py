import json
from pathlib import Path

import pytest
from conftest import DRIVE, TOUR

import omninav


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory, shared_cache: Path) -> omninav.Run:
    words = ("plain_matching", "match=l2", f"tour={TOUR}", f"log={DRIVE}")
    folder = tmp_path_factory.mktemp("api") / "run"
    record = ["match.similarities"]
    return omninav.run(*words, folder=folder, cache=shared_cache, record=record, progress=False)


def test_a_run_gives_what_its_files_hold(run):
    assert run.status == "complete"
    assert run.metrics == json.loads((run.folder / "metrics.json").read_text())
    assert run.metrics["position_error_m.median"] == run.metrics["position_error_m"]["median"]
    assert run.metrics.get("position_error_m.median") == run.metrics["position_error_m.median"]
    assert "position_error_m.median" in run.metrics
    assert not any(path in run.metrics for path in ("position_error_m.medan", "frames.median", 3))
    assert (run.metrics.get("position_error_m.medan"), run.metrics.get("medan", 0)) == (None, 0)
    assert run.metrics["frames"] == len(run.frames) == len(run.trajectory)
    assert list(run.trajectory.columns)[:2] == ["stamp_ns", "estimate_x"]
    assert run.report.read_text().startswith("<!doctype html>")
    assert len(run.map) == run.metrics["map.references"]
    assert len(omninav.load_map(str(run.folder / "map.omap"))) == len(run.map)


def test_a_run_shows_itself(run):
    assert "Position error" in str(run)
    assert "Position error" in run._repr_html_()
    assert repr(run).endswith("plain_matching, complete)")
    assert {"map", "frames"} <= set(dir(run))


def test_recorded_values_are_those_of_every_frame(run):
    values = run.values("match.similarities")
    assert run.recorded == ["match.similarities"]
    assert len(values) == len(run.frames)
    assert [float(each.values.max()) for each in values] == pytest.approx(run.frames["similarity"].tolist())


def test_what_is_not_there_is_said_with_what_to_type(run, tmp_path):
    with pytest.raises(omninav.BadInput, match=r"recorded are: match.similarities; .* record=\[fusion.belief\]"):
        run.values("fusion.belief")
    with pytest.raises(AttributeError, match="there is no mapp; did you mean 'map'"):
        run.mapp  # noqa: B018
    with pytest.raises(KeyError, match="no metric 'position_eror_m'; did you mean 'position_error_m'"):
        run.metrics["position_eror_m"]
    with pytest.raises(omninav.BadInput, match="not a run folder"):
        omninav.open_run(tmp_path)
    with pytest.raises(omninav.BadInput, match="there is a run in it; `omninav resume` continues it, folder=… names"):
        omninav.run("plain_matching", tour=TOUR, log=DRIVE, folder=run.folder)
    with pytest.raises(omninav.ProblemsFound, match=r"seed: 2\.0, expected a whole number >= 0\n +type seed=2$"):
        omninav.run("plain_matching", tour=TOUR, log=DRIVE, seed=2.0)


def test_a_folder_that_is_none_is_bad_input_with_what_to_do(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(omninav.BadInput, match="file/x: Not a directory; a part of its path is a file; name another"):
        omninav.run("plain_matching", folder=tmp_path / "file" / "x", progress=False)


@pytest.mark.parametrize(
    ("record", "what"),
    [("mach.similarities", "did you mean 'match.similarities'"), ("errors.metrics", "no output 'errors.metrics'")],
)
def test_only_what_the_loop_gives_can_be_recorded(record, what):
    with pytest.raises(omninav.ProblemsFound, match=what):
        omninav.compose("plain_matching", tour=TOUR, log=DRIVE, record=[record])


def test_what_is_updated_in_place_cannot_be_recorded():
    with pytest.raises(omninav.ProblemsFound, match="updated in place"):
        omninav.compose("omniview_cml", log=DRIVE, record=["mapping.map"])
