"""Where a run's files lie: where Hydra's settings say, with what Hydra's users look for."""

import csv
import json
import os
import re
from datetime import datetime
from pathlib import Path

import pytest
import yaml

from omninav import BadInput, open_run
from omninav.pipeline.files import locked

VARIANT = """\
# @package _global_
variant: toy
nodes:
  source: null
  count: {_target_: toys.Count}
  sum: {_target_: toys.Add}
  all: {_target_: toys.Collected}
wires:
  sum: {number: count.number}
  all:
    numbers: {from: sum.number, collect: true}
"""
SAME = ("status", "error", "job", "overrides", "seed", "graph", "config", "variant")
"""What a job's manifest says wherever it ran."""


@pytest.fixture
def toy(omninav, tmp_path: Path):
    """Runs a variant without robots, world or map."""
    (tmp_path / "mine" / "variant").mkdir(parents=True)
    (tmp_path / "mine" / "variant" / "toy.yaml").write_text(VARIANT)
    return lambda *words, **given: omninav(*words, "variant=toy", **given)


def test_a_run_lies_where_hydra_run_dir_says(toy, tmp_path: Path):
    toy("--config-dir=mine", "hydra.run.dir=out/here", "seed=3", check=True)
    folder = tmp_path / "out" / "here"
    assert json.loads((folder / "manifest.json").read_text())["status"] == "complete"
    assert yaml.safe_load((folder / ".hydra" / "overrides.yaml").read_text()) == ["seed=3", "variant=toy"]
    assert yaml.safe_load((folder / ".hydra" / "config.yaml").read_text())["seed"] == 3
    assert "run" in yaml.safe_load((folder / ".hydra" / "hydra.yaml").read_text())["hydra"]
    assert not list(tmp_path.glob("runs/[!.]*"))
    again = toy("--config-dir=mine", "hydra.run.dir=out/here")
    assert again.returncode == 2
    assert "there is a run in it" in again.stderr


def test_a_folder_of_runs_in_the_config_dir_is_said_to_be_in_the_way(toy, tmp_path: Path):
    (tmp_path / "mine" / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "mine" / "runs" / "latest" / "config.yaml").write_text("seed: 0\n")
    refused = toy("--config-dir=mine", "runs=elsewhere")
    assert refused.returncode == 2
    assert "a folder runs in the --config-dir makes a group of this setting" in refused.stderr


def test_a_run_of_its_own_name_has_hydras_files_too_and_only_settings_that_are_read(toy, tmp_path: Path):
    assert toy("--config-dir=mine", "hydra.run.dir=out", "nodes.sum._target_=toys.Nothing").returncode == 2
    assert not (tmp_path / "out").exists()  # nor where it is refused
    toy("--config-dir=mine", check=True)
    folder = tmp_path / "runs" / "latest"
    assert (folder / ".hydra" / "overrides.yaml").exists()
    config = yaml.safe_load((folder / "config.yaml").read_text())
    assert {"variant", "seed", "runs", "cache", "nodes", "wires"} <= set(config)
    assert not {"world", "route", "topics", "tour"} & set(config)


@pytest.mark.parametrize("executor", [(), ("executor.workers=1",)])
@pytest.mark.parametrize(("subdir", "name"), [("at_${seed}", "at_{}"), ("${hydra.job.override_dirname}", "seed={}")])
def test_the_jobs_of_a_sweep_lie_where_hydra_sweep_dir_and_subdir_say(toy, tmp_path, executor, subdir: str, name: str):
    words = ("hydra.sweep.dir=swept", f"hydra.sweep.subdir={subdir}", "seed=0,1", *executor)
    toy("--config-dir=mine", "-m", *words, check=True)
    for seed in (0, 1):
        (folder,) = (tmp_path / "swept").glob(f"{name.format(seed)}*")
        manifest = json.loads((folder / "manifest.json").read_text())
        assert (manifest["status"], manifest["seed"]) == ("complete", seed)
        assert (folder / ".hydra" / "config.yaml").exists()
    page = (tmp_path / "swept" / "sweep.html").read_text()
    assert "2 jobs: 2 complete" in page
    assert not list(tmp_path.glob("runs/[!.]*"))


def test_the_jobs_of_a_sweep_that_an_engine_runs_leave_the_same_and_name_what_fails(toy, tmp_path: Path):
    words = ("--config-dir=mine", "-m", "seed=0,1", "nodes.count.length_=4,none")
    ended = toy(*words, "hydra.sweep.dir=there", "executor.workers=2")
    assert ended.returncode == 2
    assert sorted(re.findall(r"^job (\d): 1 problem:\n +nodes.count.length_: 'none'", ended.stderr, re.M)) == ["1", "3"]
    assert ended.stdout.splitlines()[-1] == "sweep: there/sweep.html"
    toy(*words, "hydra.sweep.dir=here")
    for number in range(4):
        here, there = (tmp_path / place / str(number) for place in ("here", "there"))
        stated = [json.loads((job / "manifest.json").read_text()) for job in (here, there)]
        assert {name: stated[0].get(name) for name in SAME} == {name: stated[1].get(name) for name in SAME}
    assert (tmp_path / "here/0/metrics.json").read_bytes() == (tmp_path / "there/0/metrics.json").read_bytes()


@pytest.mark.parametrize("executor", [(), ("executor.workers=1",)])
def test_a_sweep_that_is_typed_again_does_only_what_is_missing(toy, tmp_path: Path, executor: tuple[str, ...]):
    words = ("--config-dir=mine", "-m", "seed=0,1", "hydra.sweep.dir=out", *executor)
    manifests = [tmp_path / "out" / number / "manifest.json" for number in "01"]
    toy(*words, check=True)
    first = [manifest.read_bytes() for manifest in manifests]
    manifests[1].unlink()  # as if it had not begun
    toy(*words, check=True)
    assert manifests[0].read_bytes() == first[0]
    assert json.loads(manifests[1].read_text())["status"] == "complete"
    assert "2 jobs: 2 complete" in (tmp_path / "out" / "sweep.html").read_text()


def test_a_job_does_not_overwrite_what_another_has_left_in_its_folder(toy, tmp_path: Path):
    swept = toy("--config-dir=mine", "-m", "hydra.sweep.dir=swept", "hydra.sweep.subdir=same", "seed=3,4")
    assert swept.returncode == 2
    assert "job 1: " in swept.stderr
    assert "job 0 has left its run there; give each job its own folder: hydra.sweep.subdir=" in swept.stderr
    manifest = json.loads((tmp_path / "swept" / "same" / "manifest.json").read_text())
    assert (manifest["seed"], manifest["job"], manifest["status"]) == (3, "0", "complete")


def test_another_sweep_does_not_take_the_folder_of_a_finished_one(toy, tmp_path: Path):
    where = ("--config-dir=mine", "-m", "hydra.sweep.dir=out")
    toy(*where, "seed=0", check=True)
    toy(*where, "seed=0", check=True)  # the same again continues it
    refused = toy(*where, "seed=5")
    assert refused.returncode == 2
    assert refused.stderr.startswith("out: another sweep is in it (seed=0 variant=toy)")
    assert json.loads((tmp_path / "out" / "0" / "manifest.json").read_text())["seed"] == 0


def test_sweeps_of_the_same_second_have_a_folder_each(toy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    class Now(datetime):
        @classmethod
        def now(cls, tz=None):
            return cls(2020, 1, 1)

    monkeypatch.setattr("hydra.core.utils.datetime", Now)
    toy("--config-dir=mine", "-m", "seed=0,1", check=True)
    again = toy("--config-dir=mine", "-m", "seed=2", check=True)
    assert again.stdout.splitlines()[-1] == "sweep: runs/2020-01-01_00-00-00_sweep_2/sweep.html"
    seeds = {
        folder.name: [json.loads(file.read_text())["seed"] for file in sorted(folder.glob("*/manifest.json"))]
        for folder in (tmp_path / "runs").glob("*_sweep*")
    }
    assert seeds == {"2020-01-01_00-00-00_sweep": [0, 1], "2020-01-01_00-00-00_sweep_2": [2]}


def test_a_folder_in_which_a_sweep_runs_is_not_taken_by_another_nor_by_the_same(toy, tmp_path: Path):
    where = ("--config-dir=mine", "-m", "hydra.sweep.dir=out")
    with locked(tmp_path / "out" / ".sweep.lock"):
        refused = toy(*where, "seed=0")
    assert refused.returncode == 2
    assert refused.stderr.startswith(f"out: process {os.getpid()} runs a sweep in it; wait until it has ended, or name")
    assert not list((tmp_path / "out").glob("*/manifest.json"))
    toy(*where, "seed=0", check=True)
    assert "another sweep is in it" in toy(*where, "seed=1").stderr


def test_values_with_spaces_are_whole_in_the_table_of_a_sweep_and_in_the_commands_of_its_jobs(toy, tmp_path: Path):
    toy("--config-dir=mine", "-m", "hydra.sweep.dir=out", "cache='a b/one','a b/two'", check=True)
    jobs = list(csv.DictReader((tmp_path / "out" / "sweep.csv").open()))
    assert [(job["cache"], job["variant"]) for job in jobs] == [("'a b/one'", "toy"), ("'a b/two'", "toy")]
    manifest = json.loads((tmp_path / "out" / "1" / "manifest.json").read_text())
    assert manifest["argv"] == ["omninav", "cache='a b/two'", "variant=toy"]


def test_what_is_said_to_be_typed_is_quoted_for_the_shell(toy, omninav, tmp_path: Path):
    ended = toy("--config-dir=mine", "hydra.run.dir='a b'", check=True)
    assert "all metrics: omninav report 'a b'\n" in ended.stdout
    folder = tmp_path / "a b"
    (folder / "report.html").unlink()
    assert f"`omninav resume '{folder}'` continues" in omninav("report", "a b").stderr
    with pytest.raises(BadInput, match="a complete run of toy leaves none, or it was removed"):
        _ = open_run(folder).report
    (folder / "metrics.json").write_text("{}")
    with pytest.raises(BadInput, match=f"`omninav resume '{folder}'` makes"):
        _ = open_run(folder).metrics
