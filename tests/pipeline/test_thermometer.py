"""The framework knows no robot: it runs, sweeps, judges and reports a thermometer's readings without our stages."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
import thermometer

from omninav.pipeline.experiment.result import read_result
from omninav.pipeline.experiment.runner import plan_experiment
from omninav.pipeline.report.sweep_page import write_sweep_page
from omninav.pipeline.report.terminal_tables import compare_table
from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.metrics_files import read_metrics
from omninav.pipeline.run.plan import plan
from omninav.pipeline.run.run_folder import start


def ran(config: dict[str, Any], folder: Path | None = None) -> Path:
    """The folder of a run that has ended."""
    planned = plan(config)
    run = start(planned, ["omninav"], folder)
    execute(run, planned)
    return run.folder


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ran(thermometer.config(tmp_path_factory.mktemp("run")))


def test_the_error_of_a_constant_lag_is_as_worked_by_hand(tmp_path: Path):
    """Without noise, with a gain of 1/2: each mean lies halfway between the one before and the truth."""
    changes = {"thermometer__noise": 0.0, "smoothing__gain": 0.5, "room__readings": 3}
    folder = ran(thermometer.config(tmp_path, **changes))
    first, second, third = (3.0 * math.sin(2.0 * math.pi * number / 40.0) for number in range(3))
    means = [first, (first + second) / 2, (first + second + 2 * third) / 4]
    errors = [abs(mean - true) for mean, true in zip(means, (first, second, third), strict=True)]
    assert read_metrics(folder).values["course"]["error_k"] == pytest.approx(errors)


def test_the_report_shows_what_the_metric_states(run: Path):
    page = (run / "report.html").read_text()
    tiles = page[page.index('class="tiles"') : page.index("<h2>Details")]
    assert tiles.index("Error, mean") < tiles.index("Within half a degree")
    assert "Error (K)" in page
    assert "Largest errors" in page
    assert page.count("data:image/png") == 1


def test_a_sweep_has_a_column_for_each_headline_and_marks_the_best(tmp_path: Path):
    rows = []
    for number, gain in enumerate((0.4, 1.0)):
        folder = ran(thermometer.config(tmp_path, smoothing__gain=gain), tmp_path / str(number))
        manifest = json.loads((folder / "manifest.json").read_text()) | {"overrides": f"gain={gain}"}
        rows.append({"job": str(number), "folder": folder, "manifest": manifest, "metrics": read_metrics(folder)})
    page = write_sweep_page(tmp_path, rows).read_text()
    assert "<th>Error, mean (K)</th><th>Within half a degree (%)</th>" in page
    first, second = page.split("<tr>")[-2:]
    assert first.count('class="best"') == 2
    assert second.count('class="best"') == 0
    runs = [{"name": row["job"], "config": {}, "manifest": {}, "metrics": row["metrics"]} for row in rows]
    assert compare_table(runs).row_count > 4


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("experiment")

    def compose(overrides: Sequence[str]) -> dict[str, Any]:
        typed = (word.partition("=") for word in overrides if not word.startswith("variant="))
        return thermometer.config(folder, **{name.replace(".", "__"): float(value) for name, _, value in typed})

    config = {"experiment": thermometer.EXPERIMENT, "runs": str(folder / "runs")}
    planned = plan_experiment(config, compose, [], ["omninav", "+experiment=gains"])
    assert planned.run()
    return planned.folder


def test_an_experiment_judges_its_claims(experiment: Path):
    verdicts = read_result(experiment / "gains.result.json").verdicts
    assert [case.holds for case in verdicts["smoothing"]] == [True]
    assert verdicts["smoothing"][0].repetitions == 6 * 2
    assert [case.holds for case in verdicts["less"]] == [False]


def test_what_the_source_computes_is_recorded_once_for_each_scenario(experiment: Path):
    recorded = [json.loads(path.read_text()) for path in (experiment / "recordings").glob("*/facts.json")]
    assert [each["facts"] for each in recorded] == 6 * [{"length_s": 40}]
    page = (experiment / "gains.md").read_text()
    assert page.count("* Recording `room of 40 readings") == 6


def test_the_page_of_an_experiment_states_how_large_each_condition_was(experiment: Path):
    page = (experiment / "gains.md").read_text()
    assert "| condition | repetitions | Readings |" in page
    assert "| gain 0.4, scenario swing 1.4 | 2/2 | 40 |" in page
    assert (experiment / "gains_curve_1.png").stat().st_size > 1000


def test_no_stage_of_a_robot_is_imported(tmp_path: Path):
    code = (
        "import sys, pathlib, thermometer\n"
        "from omninav.pipeline.run.execution import execute\n"
        "from omninav.pipeline.run.plan import plan\n"
        "from omninav.pipeline.run.run_folder import start\n"
        f"planned = plan(thermometer.config(pathlib.Path({str(tmp_path)!r})))\n"
        "execute(start(planned, ['omninav']), planned)\n"
        "print([name for name in sys.modules if name.startswith('omninav.stages')])\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, env=environment())
    assert ended.stdout.strip() == "[]", ended.stderr


def environment() -> dict[str, str]:
    tests = str(Path(__file__).parents[1])
    return {**os.environ, "PYTHONPATH": os.pathsep.join([tests, str(Path(__file__).parents[2])])}
