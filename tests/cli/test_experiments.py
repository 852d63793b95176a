"""Experiments as files: every repetition of every condition, one page, verdicts; killed and continued; failing jobs."""

import json
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest
from background_runs import kill, run_here, start

from omninav.pipeline.experiment.result import read_result
from omninav.pipeline.jobs.job_progress import JobProgress

STAGES = '''
import time
from collections.abc import Sequence
from pathlib import Path

from omninav.pipeline import Context, Outputs, Source, Stage, State, Tick, Value
from omninav.pipeline.graph.results import Metrics


class Number(Value):
    value: float


class Count(Source):
    """Counts the frames of a drive."""

    frames: int = 20

    class Place(State):
        next: int = 0

    class Out(Outputs):
        tick: Tick
        number: Number

    def step(self, ctx: Context, place: Place) -> Out | None:
        index = place.next
        place.next += 1
        return self.Out(tick=Tick(index, index), number=Number(float(index))) if index < self.frames else None


class Table(Stage):
    """What does not depend on the seed; says in a file how often it was computed."""

    bias: float = 0.0

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        with Path("computed").open("a") as file:
            file.write(f"{self.bias} {number.value}\\n")
        return self.Out(number=Number(self.bias))


class Noisy(Stage):
    """What does."""

    sigma: float = 0.1
    wait_s: float = 0.0
    raises: bool = False

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        time.sleep(self.wait_s)
        if self.raises and ctx.tick.index == 3:
            raise ValueError("the third is too many")
        return self.Out(number=Number(abs(number.value + self.sigma * ctx.rng.standard_normal())))


class Score(Stage):
    """The mean error."""

    class Out(Outputs):
        metrics: Metrics

    def step(self, ctx: Context, errors: Sequence[Number]) -> Out:
        found = [e.value for e in errors]
        laps = [{"error_m": sum(found[n : n + 5]) / 5 / (1 + n)} for n in range(0, len(found), 5)]
        steps = {"step": list(range(len(found))), "error_m": found, "odometry_m": [0.1 * n for n in range(len(found))]}
        error = sum(found) / len(found)
        lucky = error if ctx.rng.random() < 0.5 else None
        metrics = {"error_m": error, "lucky_m": lucky, "frames": len(found), "laps": laps, "steps": steps}
        return self.Out(metrics=Metrics(metrics))
'''
VARIANT = """\
# @package _global_
variant: dice
nodes:
  source: null
  counter: {_target_: my_stages.Count, frames: 20}
  table: {_target_: my_stages.Table, bias: 0.0}
  noisy: {_target_: my_stages.Noisy, sigma: 0.1, wait_s: 0.0, raises: false}
  score: {_target_: my_stages.Score}
wires:
  table: {number: counter.number}
  noisy: {number: table.number}
  score: {errors: {from: noisy.number, collect: true}}
"""
EXPERIMENT = """\
# @package experiment
name: dice
title: A table of dice
about: Whether a bias is seen.
variant: dice
sweep:
  method: {fair: nodes.table.bias=1.0, loaded: nodes.table.bias=2.0}
  tour: {TT1: nodes.counter.frames=20, TT2: nodes.counter.frames=30}
repetitions: 6
measures:
  error: {title: Error (cm), path: [after.error_m, error_m], scale: 100.0}
page: {rows: [method], columns: tour}
published:
  error: {fair: {TT1: 102, TT2: 30}}
claims:
  better:
    {statement: fair is better than loaded, measure: error, of: {method: fair}, below: {method: loaded}, paper: better}
  published: {statement: fair is as good as the paper's, measure: error, of: {method: fair}, at_most: published}
  best: {statement: loaded is best, measure: error, of: {method: loaded}, lowest: true}
profiles:
  quick: {repetitions: 2}
"""
LAPS = """\
# @package experiment
name: laps
title: Laps of dice
about: Whether errors fall from lap to lap.
variant: dice
set: nodes.noisy.wait_s=0.001
sweep:
  method: {fair: nodes.table.bias=1.0, loaded: nodes.table.bias=2.0}
  noise: {low: nodes.noisy.sigma=0.1, high: nodes.noisy.sigma=0.3}
without: [{method: fair, noise: high}]
scenarios:
  a: nodes.counter.frames=20
  b: nodes.counter.frames=22
  c: nodes.counter.frames=24
  d: nodes.counter.frames=26
  e: nodes.counter.frames=28
  f: nodes.counter.frames=30
development: {chosen on: nodes.counter.frames=10}
profiles: {development: {scenarios: {a: null, b: null, c: null, d: null, e: null, f: null}}}
repetitions: 2
measures:
  error: {title: Error (m), path: [error_m], digits: 2}
  last: {title: Last lap (m), path: [laps.*.error_m], aggregate: last, digits: 2}
  rise: {title: Largest rise (m), path: [laps.*.error_m], aggregate: largest_rise, digits: 2}
  lucky: {title: Error of the lucky (m), path: [lucky_m], digits: 2}
  time: {title: Time (ms), path: [p95_ms], stages: [noisy], digits: 2}
page: {rows: [method], columns: noise, drawn: [error, last]}
curves:
  - {title: Error (m), x_label: lap, path: laps.*.error_m}
  - title: Error along the way (m)
    x_label: step
    path: steps.error_m
    x_path: steps.step
    panels: noise
    only: {method: loaded}
    reference: {odometry alone: steps.odometry_m}
claims:
  fall: {statement: errors fall, measure: rise, below: 0.0}
  half:
    {statement: half of the loaded one's, measure: error, of: {method: fair}, ratio_to: {method: loaded}, at_most: 0.6}
  lucky: {statement: the lucky are better, measure: lucky, of: {method: fair}, at_most: 2.0}
"""
ONCE = 2 * (20 + 30)
"""Lines in `computed`: in two conditions, each frame once."""


def with_files(place: Path) -> Path:
    (place / "mine/variant").mkdir(parents=True)
    (place / "mine/experiment").mkdir()
    (place / "my_stages.py").write_text(STAGES)
    for name, text in {"variant/dice": VARIANT, "experiment/dice": EXPERIMENT, "experiment/laps": LAPS}.items():
        (place / f"mine/{name}.yaml").write_text(text)
    return place


@pytest.fixture
def place(tmp_path: Path) -> Path:
    return with_files(tmp_path)


MINE = ("--config-dir", "mine", "+experiment=dice")
TT1 = "~experiment.sweep.tour.TT2"
"""Half of the conditions."""


CLOSED_LOOP = """\
# @package experiment
name: about
title: Wandering about
about: As the command line does it.
variant: wander
repetitions: 1
common: world=home_store_demo nodes.source.seconds=0.4
sweep: {day: {first: day=0}}
scenarios: {here: "nodes.source.start=[4.2,4.0,0.5]", there: "nodes.source.start=[5.0,5.0,0.5]"}
measures: {way: {title: Way (m), path: [drive.distance_m]}}
page: {rows: [], columns: day}
"""


@dataclass
class Finished:
    """The whole experiment, run once for several tests; `go` runs a command in its folder."""

    place: Path
    said: str

    def go(self, *words: str) -> str:
        ended = run_here(self.place, *words)
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout

    def computed(self) -> int:
        """How many frames of the table were computed so far."""
        return len((self.place / "computed").read_text().split("\n")) - 1


@pytest.fixture(scope="module")
def dice(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    finished = Finished(with_files(tmp_path_factory.mktemp("dice")), "")
    finished.said = finished.go(*MINE)
    return finished


def results(folder: Path) -> dict[str, str]:
    """The metrics of each repetition, by the path of its file."""
    kept = {str(path.relative_to(folder)): json.loads(path.read_text()) for path in folder.rglob("seed_*.json")}
    return {path: json.dumps(content["metrics"]) for path, content in kept.items()}


def test_a_page_with_verdicts_and_what_repetitions_share_computed_once(dice: Finished):
    folder = dice.place / "runs/dice_full"
    assert "page: runs/dice_full/dice.html" in dice.said
    *verdicts, why, _ = dice.said.splitlines()[-5:]
    assert [line.split("  ")[0] for line in verdicts] == ["undecided"] * 3
    assert why == "undecided: one scenario says nothing about the next; a verdict needs several"
    verdicts = read_result(folder / "dice.result.json").verdicts
    better, published, best = verdicts["better"], verdicts["published"], verdicts["best"]
    assert [case.holds for case in better] == [None, None]  # six seeds of one drive say nothing of another
    assert [case.difference for case in better] == pytest.approx([-100.0, -100.0], abs=10.0)
    assert [case.ours < case.other for case in published] == [True, False]
    assert best[0].difference > 0.0
    page = (folder / "dice.md").read_text()
    assert "(102.0)" in page
    assert not [line for line in page.split("\n") if line.endswith(" ")]
    stated = json.loads((folder / "experiment.json").read_text())
    assert f"Made with omninav {stated['omninav']}" in page
    assert f"Made with omninav {stated['omninav']}" in (folder / "dice.html").read_text()
    assert (folder / "dice.png").stat().st_size > 1000
    assert dice.computed() == ONCE
    assert len(results(folder)) == 4 * 6
    assert not list(folder.rglob("*.spool"))


def test_a_finished_experiment_is_found_and_its_folder_can_be_resumed(dice: Finished):
    before = dice.computed()
    assert dice.go("resume", "runs/dice_full", "my_stages").split("\n")[1:] == dice.said.split("\n")
    assert dice.computed() == before


def test_a_finished_experiment_of_ones_own_has_pages_and_is_no_run(dice: Finished):
    said = dice.go("experiments", "runs/dice_full", "pages", "--config-dir", "mine")
    assert "claims: pages/claims.md" in said
    for words in (("report",), ("explain",), ("compare", "runs/dice_full")):
        ended = run_here(dice.place, *words, "runs/dice_full")
        assert ended.returncode == 2
        assert "an experiment, not a run; open " in ended.stderr
        assert "dice_full/dice.html" in ended.stderr


def test_series_within_runs_drives_as_repetitions_and_times_of_stages(omninav, place: Path):
    said = omninav("check", "--config-dir", "mine", "+experiment=laps", check=True).stdout
    assert "3 conditions (2 method, 2 noise), each with 2 repetitions in each of 6 scenarios" in said
    omninav("--config-dir", "mine", "+experiment=laps", check=True)
    folder = place / "runs/laps_full"
    verdicts = read_result(folder / "laps.result.json").verdicts
    fall, (half,), (lucky,) = verdicts["fall"], verdicts["half"], verdicts["lucky"]
    assert [case.holds for case in fall] == [True, True, True]
    assert [case.repetitions for case in fall] == [12, 12, 12]
    assert half.ratio is True
    assert half.ours == pytest.approx(0.5, abs=0.05)
    assert half.holds is True
    assert lucky.holds is True
    judged = lucky.judged
    assert 0 < judged < 12
    page = (folder / "laps.md").read_text()
    assert f", {judged} of 12" in page
    assert f"({judged} of 12)" in page
    assert "with seeds 0 to 11, 2 in each of 6 scenarios (a, b, c, d, e, f)" in page
    assert re.search(r"\*\*Time \(ms\)\*\*\n(.*\n){3}\| fair \| [1-9]", page)
    pictures = ["laps.png", "laps_curve_1.png", "laps_curve_2.png", "laps_last.png"]
    assert sorted(path.name for path in folder.glob("*.png")) == pictures
    assert all(f"({name})" in page for name in pictures)
    assert (folder / "laps.html").read_text().count("data:image/png") == 4
    assert len(results(folder)) == 3 * 6 * 2
    omninav("--config-dir", "mine", "+experiment=laps", "profile=development", check=True)
    chosen_on = (place / "runs/laps_development/laps.md").read_text()
    assert "2 in each of 1 scenario (chosen on)" in chosen_on
    assert chosen_on.count("development ") >= 3
    assert "| holds |" in page
    assert "| holds |" not in chosen_on


def test_a_closed_loop_drives_for_itself(omninav, tmp_path: Path):
    (tmp_path / "mine/experiment").mkdir(parents=True)
    (tmp_path / "mine/experiment/about.yaml").write_text(CLOSED_LOOP)
    omninav("--config-dir", "mine", "+experiment=about", "cache=null", check=True)
    folder = tmp_path / "runs/about_full"
    assert len(results(folder)) == 2
    assert not (folder / "recordings").exists()


def test_a_killed_experiment_goes_on_where_it_was(dice: Finished):
    process = start(dice.place, *MINE, TT1, "nodes.noisy.wait_s=0.01", "runs=killed")
    folder = dice.place / "killed/dice_full"
    while len(results(folder)) < 5:
        assert process.poll() is None
        time.sleep(0.05)
    kill(process)
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("seed_*.json")}
    assert 5 <= len(before) < 12
    dice.go("resume", "killed/dice_full", "my_stages")
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert len(results(folder)) == 12
    assert results(folder).items() <= results(dice.place / "runs/dice_full").items()


def test_a_failing_job_is_named_on_the_page_and_the_others_finish(omninav, place: Path):
    file = place / "mine/experiment/dice.yaml"
    text = EXPERIMENT.replace("loaded: nodes.table.bias=2.0", "loaded: nodes.noisy.raises=true")
    file.write_text(text.replace("measures:", "measures:\n  gone: {title: Gone, path: [eror_m]}", 1))
    ended = omninav(*MINE, "profile=quick")
    assert ended.returncode == 1
    said = "stage 'noisy' (my_stages.Noisy) failed at tick 3 (log 0, frame 0): ValueError: the third is too many"
    assert f"method loaded, tour TT1: {said}" in ended.stdout
    early = "so far: experiment.measures.gone.path: no run has eror_m; did you mean 'error_m'"
    assert early in ended.stdout  # before all have run
    folder = place / "runs/dice_quick"
    for page in ("dice.md", "dice.html"):
        assert "the third is too many" in (folder / page).read_text()
    assert len(results(folder)) == 4
    assert "Traceback" in (folder / "conditions/method_loaded_tour_TT1/run.log").read_text()


def test_what_is_wrong_with_a_file_is_said_before_anything_runs(omninav, place: Path):
    ours = place / "mine/experiment/dice.yaml"
    two = EXPERIMENT.replace("below: {method: loaded}", "below: {method: loadad}")
    assert "did you mean 'profile=quick'?" in omninav(*MINE, "profile=quik").stderr
    for wrong, *said in (
        (two.replace("columns: tour", "columns: tours"), "no 'loadad'", "did you mean 'loaded'?", "no 'tours'"),
        (EXPERIMENT.replace("bias=2.0", "biass=2.0"), "biass"),
        (EXPERIMENT.replace("scale: 100.0", "stages: [nosy]"), "no condition has a stage 'nosy'", "mean 'noisy'?"),
    ):
        ours.write_text(wrong)
        ended = omninav(*MINE)
        assert ended.returncode == 2
        for words in said:
            assert words in ended.stderr
    ours.write_text(EXPERIMENT + "  slow: [1\n")
    ended = omninav(*MINE)
    assert ended.returncode == 2
    assert re.fullmatch(r"\S+/mine/experiment/dice.yaml, line \d+, column \d+: not valid YAML: .*\n", ended.stderr)
    assert not (place / "runs").exists()


def test_check_checks_every_condition_and_runs_none(omninav, place: Path):
    said = omninav("check", *MINE, check=True).stdout.splitlines()
    assert said[:2] == [
        "dice, profile full: nothing wrong with it",
        "4 conditions (2 method, 2 tour), each with 6 repetitions",
    ]
    assert "24 runs in all" in said[2]
    said = omninav("check", *MINE, "profile=quick", "nodes.noisy.sigma=0.2", check=True).stdout
    assert "each with 2 repetitions" in said
    (place / "mine/experiment/dice.yaml").write_text(EXPERIMENT.replace("bias=2.0", "biass=2.0"))
    ended = omninav("check", *MINE)
    assert ended.returncode == 2
    assert "method loaded, tour TT1: nodes.table.biass" in ended.stderr
    assert "method fair" not in ended.stderr
    assert not (place / "runs").exists()


def test_frames_of_jobs_add_up_and_silent_ones_count_as_the_mean_of_the_others():
    frames = JobProgress(3)
    assert (frames.done, frames.total) == (0, None)
    frames.on_message("training", {"frames": 100, "of": 3000})
    assert (frames.done, frames.total) == (100, 9000)
    frames.on_message("tt1", {"frames": 1, "of": 400})
    frames.on_message("tt1", {"seed": 3})
    assert (frames.done, frames.total) == (101, 3400 + 1700)
    frames.end("tt1")
    assert (frames.done, frames.ended) == (500, 1)
    frames.end("training", well=False)
    frames.end("cached")
    assert (frames.done, frames.total, frames.ended) == (500, 500, 3)


@contextmanager
def dask_cluster() -> Iterator[tuple[str, ...]]:
    distributed = pytest.importorskip("distributed", reason="pip install 'omninav[dask]'")
    how = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "protocol": "tcp", "dashboard_address": ":0"}
    with distributed.LocalCluster(**how) as cluster:
        yield "executor=dask", f"executor.address={cluster.scheduler_address}"


@pytest.mark.parametrize(
    "executor",
    [nullcontext(("executor.workers=1",)), nullcontext(("executor.workers=8",)), dask_cluster()],
    ids=["one process", "eight processes", "dask"],
)
def test_results_are_the_same_bytes_wherever_they_were_computed(dice: Finished, executor, request):
    runs = dice.place / request.node.callspec.id.replace(" ", "_")
    with executor as words:
        dice.go(*MINE, *words, f"runs={runs}", "cache=null")
    here, there = dice.place / "runs/dice_full", runs / "dice_full"
    first, second = (read_result(folder / "dice.result.json") for folder in (here, there))
    assert (second.verdicts, second.cells, second.curves) == (first.verdicts, first.cells, first.curves)
    assert results(there) == results(here)
