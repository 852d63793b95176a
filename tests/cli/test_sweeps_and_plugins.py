"""Sweeps, failing jobs, and the four ways to a third party's stage."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from conftest import Command

from omninav.pipeline.cli.sweep_jobs import LOGS, _end_of
from omninav.pipeline.jobs.job import Job, Outcome

ROOT = Path(__file__).resolve().parents[2]
EDGES = ROOT / "examples" / "edges"
SHORT = ("landmarks=none", "nodes.source.stop=12")  # of tour and drive, where a result is not looked at
RAISES = ("--config-dir", "examples/edges/conf", "features=raises_at_seed", *SHORT)


@pytest.fixture
def swept(omninav, shared_cache: Path, tmp_path: Path):
    """Runs a sweep beside the examples. Returns how it ended, and its folder."""
    (tmp_path / "examples").symlink_to(ROOT / "examples")

    def run(*words: str, command: Command = omninav) -> tuple[subprocess.CompletedProcess[str], Path]:
        ended = command("-m", *words, f"cache={shared_cache}")
        (folder,) = (tmp_path / "runs").glob("*_sweep")
        return ended, folder

    return run


def row_of_edges(listed: str) -> str:
    """The line of `omninav stages features` that is the example's."""
    return next(line for line in listed.splitlines() if line.startswith("features.edges"))


def manifests(sweep: Path) -> list[dict]:
    return [json.loads(file.read_text()) for file in sorted(sweep.glob("*/manifest.json"))]


def test_a_sweep_runs_every_combination_and_has_one_page(swept):
    ended, sweep = swept("match=selective,l2", "seed=0,1", *SHORT)
    assert ended.stdout.splitlines()[-1] == f"sweep: runs/{sweep.name}/sweep.html"
    assert [m["status"] for m in manifests(sweep)] == ["complete"] * 4
    assert manifests(sweep)[0]["overrides"][:2] == ["match=selective", "seed=0"]
    assert not any("<figure id=" in (sweep / str(n) / "report.html").read_text() for n in range(4))
    page = (sweep / "sweep.html").read_text()
    assert all(f"<code>{value}</code>" in page for value in ("selective", "l2"))
    assert '<th class="text">match</th>' in page


def test_a_failing_job_is_named_at_once_and_the_others_finish(swept):
    ended, sweep = swept(*RAISES, "seed=0,1,2")
    assert ended.returncode == 1
    assert "job 1: stage 'features'" in ended.stderr
    assert "raises at seed 1" in ended.stderr
    assert [m["status"] for m in manifests(sweep)] == ["complete", "failed", "complete"]
    assert "raises at seed 1" in (sweep / "sweep.html").read_text()
    assert "Traceback" in (sweep / "1" / "run.log").read_text()


@pytest.mark.parametrize(
    ("taken", "words", "complete"), [("1", ("executor=local", "executor.workers=1"), 2), ("sweep.html/folder", (), 3)]
)
def test_the_others_finish_where_a_jobs_end_cannot_be_written(
    omninav, shared_cache: Path, tmp_path: Path, taken: str, words: tuple[str, ...], complete: int
):
    at = tmp_path / "sweep" / taken
    at.parent.mkdir(parents=True)
    at.touch()
    ended = omninav("-m", "seed=0,1,2", *SHORT, *words, f"cache={shared_cache}", "hydra.sweep.dir=sweep")
    assert ended.returncode in (1, 2)
    assert f"sweep/{taken.partition('/')[0]}" in ended.stderr
    assert "Error executing job" not in ended.stderr  # words of Hydra
    assert [m["status"] for m in manifests(tmp_path / "sweep")] == ["complete"] * complete


def test_a_job_whose_folder_a_full_disk_did_not_take_ends_in_its_sweep(tmp_path: Path):
    (tmp_path / LOGS).mkdir()
    (tmp_path / LOGS / "2.folder").touch()
    job = Job("2", "module:name", {"sweep": str(tmp_path), "overrides": ["seed=2"]}, tmp_path / LOGS / "2.log")
    _end_of(job, Outcome("no space"))
    assert [m["job"] for m in manifests(tmp_path)] == ["2"]


def test_jobs_in_several_processes_give_the_same_and_leave_their_exit_code(
    omninav, omninav_process, swept, shared_cache: Path, tmp_path: Path
):
    joblib = ("hydra/launcher=joblib", "hydra.launcher.n_jobs=2")
    ended, sweep = swept(*RAISES, "seed=0,1", *joblib, command=omninav_process)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    assert [m["status"] for m in manifests(sweep)] == ["complete", "failed"]
    omninav(*RAISES, "seed=0", f"cache={shared_cache}", check=True)
    same = tmp_path / "runs" / "latest" / "trajectory.tum"
    assert (sweep / "0" / "trajectory.tum").read_bytes() == same.read_bytes()


def test_a_stage_by_its_path_alone(omninav):
    target = f"{EDGES / 'omninav_edges.py'}:EdgeHistogram"
    words = ("~nodes.features", f'+nodes.features={{_target_: "{target}"}}')
    assert "nothing wrong" in omninav("check", *words, check=True).stdout


def test_a_stage_by_a_config_folder(omninav, tmp_path: Path):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    words = ("--config-dir", "examples/edges/conf", "features=edge_directions", "nodes.features.directions=12")
    assert "nothing wrong" in omninav("check", *words, check=True).stdout


def test_a_stage_by_the_environment_runs_by_name(
    omninav, shared_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("OMNINAV_STAGES", f"features.edges={EDGES / 'omninav_edges.py'}:EdgeHistogram")
    omninav("features=edges", *SHORT, f"cache={shared_cache}", check=True)
    config = (tmp_path / "runs" / "latest" / "config.yaml").read_text()
    assert "omninav_edges.py:EdgeHistogram" in config
    assert "[environment]" in row_of_edges(omninav("stages", "features", check=True).stdout)


def test_a_stage_of_an_installed_package_by_name(omninav, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    place = tmp_path / "site"
    offline = ("--quiet", "--no-deps", "--no-build-isolation", "--no-index")
    command = [sys.executable, "-m", "pip", "install", *offline, "--target", str(place), str(EDGES)]
    subprocess.run(command, capture_output=True, check=True)
    monkeypatch.syspath_prepend(place)
    assert "[installed]" in row_of_edges(omninav("stages", "features", check=True).stdout)
    assert "nothing wrong" in omninav("check", "features=edges", check=True).stdout


def test_a_broken_plugin_is_said_and_never_a_crash(omninav, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "broken.py").write_text("import not_there\n")
    monkeypatch.setenv("OMNINAV_STAGES", "features.broken=broken.py:Thing")
    listed = omninav("stages", "features", check=True)
    assert "features.broken" in listed.stdout
    assert "[environment] cannot be used: module 'broken.py'" in listed.stdout
    assert "1 plugin cannot be loaded; all other stages can be used" in listed.stderr
    used = omninav("check", "features=broken")
    assert (used.returncode, "No module named 'not_there'" in used.stderr) == (2, True)


def test_an_optimiser_gets_each_jobs_objective_and_a_failed_one_counts_as_a_failed_trial(swept):
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper", reason="pip install 'omninav[optuna]'")
    # The grid's sampler raises where the last of its points fails, and it takes them in any order.
    optuna = ("hydra/sweeper=optuna", "hydra/sweeper/sampler=random", "hydra.sweeper.sampler.seed=1")
    choices = ("hydra.sweeper.n_trials=4", "seed=choice(0,1)", "nodes.match.headings=choice(18,36)")
    ended, sweep = swept(*RAISES, *optuna, *choices, "objective=position_error_m.median")
    failed = re.findall(r"^job \d: stage 'features'", ended.stderr, re.MULTILINE)
    assert f"optimum: runs/{sweep.name}/optimization_results.yaml" in ended.stdout
    found = yaml.safe_load((sweep / "optimization_results.yaml").read_text())
    figures = [json.loads(file.read_text()) for file in sweep.glob("*/metrics.json")]
    assert len(figures) == 4 - len(failed)
    assert 0 < len(failed) < 4
    assert found["best_value"] == min(figure["position_error_m"]["median"] for figure in figures)
    assert found["best_params"]["seed"] == 0


def test_an_optimiser_whose_jobs_all_fail_says_so_in_a_line(swept):
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper", reason="pip install 'omninav[optuna]'")
    optuna = ("hydra/sweeper=optuna", "hydra/sweeper/sampler=grid", "hydra.sweeper.n_trials=1")
    ended, _ = swept(*RAISES, *optuna, "seed=choice(1)", "objective=position_error_m.median")
    assert ended.returncode == 1
    assert "every job failed: there is no best one" in ended.stderr
    assert "Traceback" not in ended.stderr


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("objective=null",), "hydra/sweeper=optuna: nothing says what it optimises; type objective="),
        (("hydra.sweeper.n_jobs=0",), "hydra.sweeper.n_jobs: 0, expected a whole number >= 1"),
        (("hydra.sweeper.n_trials=abc",), "Value 'abc' of type 'str' could not be converted to Integer"),
        (("hydra.sweeper.direction=sideways",), "Please set either 'minimize' or 'maximize' to direction"),
        (("hydra/sweeper=basic", "hydra.sweeper.n_trials=2"), "n_trials: this sweeper has no such setting"),
    ],
)
def test_what_an_optimiser_cannot_do_is_said_before_the_first_job(omninav, words: tuple[str, ...], said: str):
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper", reason="pip install 'omninav[optuna]'")
    well = ("hydra/sweeper=optuna", "objective=position_error_m.p90")
    given = {word.partition("=")[0]: word for word in (*well, *words)}
    ended = omninav("-m", *given.values(), "seed=choice(0,1)", *SHORT)
    assert (ended.returncode, "Traceback" in ended.stderr) == (2, False)
    assert said in ended.stderr


def test_an_objective_that_no_run_has_is_named_with_what_there_is(omninav, shared_cache: Path):
    ended = omninav("variant=plain_matching", SHORT[1], f"cache={shared_cache}", "objective=position_error_m.medan")
    assert ended.returncode == 2
    assert "did you mean 'position_error_m.median'?" in ended.stderr
