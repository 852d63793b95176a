import sys
import threading

import pytest
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.cli.main import main


@pytest.fixture(scope="module")
def sweep(tmp_path_factory, shared_cache):
    settings = {"tour": TOUR, "log": DRIVE, "cache": shared_cache, "nodes.source.stop": 12}
    words = ("plain_matching", "match=selective,l2")
    before = list(sys.argv)
    made = omninav.sweep(*words, seed=range(2), folder=tmp_path_factory.mktemp("swept") / "sweep", **settings)
    assert sys.argv == before
    return made


def test_a_sweep_is_one_table_with_seeds_and_one_with_means_and_intervals(sweep):
    jobs, means = sweep.jobs, sweep.means
    assert jobs["status"].tolist() == ["complete"] * 4
    assert jobs["match"].tolist() == ["selective", "selective", "l2", "l2"]
    assert jobs["seed"].tolist() == [0, 1, 0, 1]
    assert (means["match"].tolist(), means["jobs"].tolist()) == (["selective", "l2"], [2, 2])
    figures = jobs.groupby("match")["position_error_m.median"].mean()
    assert means.set_index("match")["position_error_m.median"].to_dict() == pytest.approx(figures.to_dict())
    assert [run.metrics["frames"] for run in sweep.runs] == jobs["frames"].tolist()
    assert "Means over seeds" in sweep.report.read_text()


def test_a_quiet_sweep_leaves_alone_what_others_print(sweep, monkeypatch, capsys):
    def printing(words, on_sweep):
        print("own")
        other = threading.Thread(target=lambda: print("another's"))
        other.start()
        other.join()
        on_sweep(sweep.folder)

    monkeypatch.setattr("omninav.pipeline.api.sweep.command", printing)
    omninav.sweep("plain_matching", seed=[0], progress=False)
    assert capsys.readouterr().out == "another's\n"


def test_a_sweep_is_opened_reported_and_compared_by_its_folder(sweep, capsys):
    assert len(omninav.open_sweep(sweep.folder).runs) == 4
    assert main(["report", str(sweep.folder)]) == 0
    assert "selective" in capsys.readouterr().out
    assert main(["compare", str(sweep.folder)]) == 0
    assert "Position error" in capsys.readouterr().out


def test_a_sweep_in_place_of_a_run_is_said_with_a_job_of_it(sweep, capsys):
    assert main(["explain", str(sweep.folder)]) == 2
    said = f"{sweep.folder}: a sweep, not a run folder; name a job of it, such as {sweep.folder}/0"
    assert capsys.readouterr().err.splitlines()[-1] == said


def test_what_is_no_sweep_is_said(tmp_path):
    with pytest.raises(omninav.BadInput, match="not a sweep's folder"):
        omninav.open_sweep(tmp_path)


def test_a_sweep_of_too_many_values_or_none_is_refused_before_they_are_listed():
    for values, what in (
        (range(10**12), "seed: a sweep of 1,000,000,000,000 values, expected 1 to 100,000"),
        ([0] * 100_001, "seed: a sweep of 100,001 values"),
        ([], "seed: a sweep of 0 values"),
        (range(3, 3), "seed: a sweep of 0 values"),
    ):
        with pytest.raises(omninav.BadInput, match=what):
            omninav.sweep("plain_matching", seed=values, progress=False)
    with pytest.raises(omninav.BadInput, match="a sweep of 10,000,000 jobs, expected at most 100,000"):
        omninav.sweep("plain_matching", seed=range(10_000), checkpoint_s=range(1, 1001), progress=False)
