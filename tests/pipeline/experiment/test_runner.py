"""An experiment from its file to its result; its jobs run one after the other, in this process."""

import functools
import json
import re
import zlib
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import made_experiments
import numpy as np
import pytest

import toys
from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.experiment import runner
from omninav.pipeline.experiment.result import ExperimentResult
from omninav.pipeline.jobs.job import Job, Outcome
from omninav.pipeline.jobs.worker_pool import WorkerPool

FILE = made_experiments.FILE | {
    "sweep": {"more": {"one": "more=1", "ten": "more=10"}},
    "scenarios": {"short": "frames=2", "long": "frames=4"},
    "repetitions": 3,
    "measures": {"mean": {"title": "Mean", "path": ["numbers.all"]}},
    "page": {"rows": [], "columns": "more"},
}


def compose(words: Sequence[str]) -> dict[str, Any]:
    """The numbers of a drive, some more, and noise."""
    given = {"fails": "-1", **dict(word.split("=") for word in words)}
    source, fail = (
        {"_target_": "Drive", "length_": int(given["frames"])},
        {"_target_": "Fail", "at": int(given["fails"])},
    )
    noisy = {"from": "noise.number", "collect": True}
    wires = {
        "sum": {"number": "source.number", "other": "artifacts.more"},
        "fail": {"number": "sum.number"},
        "noise": {"number": "fail.number"},
        "all": {"numbers": noisy, "present": noisy},
    }
    more = {"graph": toys.graph_of_toys({"more": {"_target_": "Constant", "value": float(given["more"])}})}
    return toys.graph_of_toys(
        {"source": source, "sum": "Add", "fail": fail, "noise": "Noise", "all": "Collected"},
        wires,
        artifacts={"more": more | {"output": "more.number"}},
        cache=given["cache"],
    )


def run(place: Path, monkeypatch: pytest.MonkeyPatch, **file: object) -> tuple[bool, ExperimentResult, list[str], int]:
    """Run the experiment: whether all went well, the result, the jobs that ran, and how many sums were computed."""
    ran, sums, add = [], [], toys.Add.step

    class HereAndNow(WorkerPool):
        def run(self, jobs: Sequence[Job], on_message: Any = print, on_end: Any = print) -> dict[str, Outcome]:
            ended = {}
            for job in jobs:
                ran.append(job.name)
                module, _, name = job.function.partition(":")
                try:
                    given = json.loads(json.dumps(job.given))
                    getattr(import_module(module), name)(given, functools.partial(on_message, job))
                    ended[job.name] = Outcome()
                except StageFailed as failed:
                    ended[job.name] = Outcome(str(failed))
                on_end(job, ended[job.name])
            return ended

    monkeypatch.setattr(runner, "WorkerPool", HereAndNow)
    monkeypatch.setattr("omninav.pipeline.experiment.page.plots_of", lambda *_: [])
    monkeypatch.setattr(toys.Add, "step", functools.wraps(add)(lambda *a, **k: (sums.append(a), add(*a, **k))[1]))
    config = {"experiment": FILE | file, "runs": str(place), "executor": {"workers": 9}}
    words = ["seed=0", f"cache={place.parent}/cache"]
    experiment = runner.prepare_experiment(config, compose, words, ["omninav", "+experiment=test"])
    return experiment.run(), experiment.result(), ran, len(sums)


def test_every_seed_runs_in_every_scenario_and_what_does_not_depend_on_it_once_in_each_job(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    well, result, ran, sums = run(tmp_path / "runs", monkeypatch)
    assert [name.rpartition(" ")[0] for name in ran[:4]] == ["a drive of 2", "a drive of 4", "more", "more"]
    assert ran[4:] == [f"more_{m}_{s}" for m in ("one", "ten") for s in ("short_0", "short_2", "long_3", "long_5")]
    assert (well, result.missing, result.failures, sums) == (True, 0, {}, 2 * 2 * (2 + 4))
    assert result.repeated.startswith("6 repetitions of each condition with seeds 0 to 5, 3 in each of 2 scenarios (sh")
    assert result.common_overrides == ("variant=none", "seed=0")
    row = result.conditions[1]
    assert (row.name, row.done, row.overrides) == ("more one, scenario long", "3/3", "more=1 frames=4")
    page = (tmp_path / "runs/test_full/test.md").read_text()
    recordings = re.findall(r"^\* Recording `(.*) \w{12}`: (.*)\.$", page, re.MULTILINE)
    assert recordings == [("a drive of 2", "length 2 m"), ("a drive of 4", "length 4 m")]
    assert "\n| condition | repetitions | Present |\n|---|---|---|\n| more one, scenario short | 3/3 | 2 |\n" in page
    for cell, more in zip(result.cells["mean"], (1.0, 10.0), strict=True):
        noises = [np.random.default_rng([seed, zlib.crc32(b"noise")]).normal(size=4) for seed in range(6)]
        means = [*(more + 0.5 + each[:2].mean() for each in noises[:3]), *(more + 1.5 + n.mean() for n in noises[3:])]
        found = np.mean(means), np.std(means), np.median(means)
        assert (cell.figure, cell.spread, cell.median) == pytest.approx(found)
    assert run(tmp_path / "others", monkeypatch)[1:] == (result, [], 0)  # all of it is in the cache
    _, timed, ran, sums = run(tmp_path / "timed", monkeypatch, shared=False, cores=1)
    assert (timed.cells, len(ran), sums) == (result.cells, 2 + 4, 2 * 3 * (2 + 4))  # a job for each condition


def test_a_condition_that_fails_is_named_and_runs_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep = {"more": {"one": "more=1", "none": "more=1 fails=1"}}
    well, result, *_ = run(tmp_path / "runs", monkeypatch, sweep=sweep)
    failed = ["more none, scenario short", "more none, scenario long"]
    assert (well, list(result.failures), result.missing) == (False, failed, 0)
    assert [(cell.found, cell.ran) for cell in result.cells["mean"]] == [(6, 6), (0, 6)]
    assert [row.done for row in result.conditions] == ["3/3", "3/3", "0/3", "0/3"]
    assert json.loads((tmp_path / "runs/test_full/experiment.json").read_text())["status"] == "failed"
    ran = run(tmp_path / "runs", monkeypatch, sweep=sweep)[2]
    assert ran == [f"more_none_{each}" for each in ("short_0", "short_1", "short_2", "long_3", "long_4", "long_5")]
