"""Localisation in maps of 10^3 to 10^6 references: time and memory of an image, and when a lost robot is found.

    python benchmarks/million.py FOLDER                     # makes what it needs in FOLDER: 4 GB, half an hour
    python benchmarks/million.py FOLDER --sizes 1000 10000  # smaller
    python benchmarks/million.py FOLDER --plot docs/pictures/large_maps.svg

Maps as in `large_map.py`; views are rendered images of a drive on another day. Each map is measured in a process of its
own, on one thread; times are those of the processor, since others may be at work on the machine.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.large_map import RENDERED, Frame, frames, made, views
from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.candidates.index import IndexedCandidates, search_in
from omninav.stages.candidates.reference_index import BuildReferenceIndex, BuildReferenceIndexState
from omninav.stages.fusion.importance_resampling import ImportanceResampling
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.sensor.appearance_length_scale import AppearanceLengthScale
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.sensor.similarity_proposals import SimilarityProposals
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.reference_index import ReferenceIndex

SIZES = (1_000, 10_000, 100_000, 1_000_000)
TRACKED, LOOKED_UP, SEARCHED = 60, 24, 800
"""Frames that are tracked, views that are looked up in the whole map, and frames given to find a lost robot."""


def milliseconds(calls: list[Callable[[], object]]) -> float:
    """Median of calls, in milliseconds of this process's own time: others may be at work on the machine."""
    taken = []
    for call in calls:
        start = time.process_time()
        call()
        taken.append(time.process_time() - start)
    return statistics.median(taken) * 1e3


def resident() -> dict[str, float]:
    """Resident megabytes: the process's own, and those of mapped files, libraries above all."""
    fields = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return {name: int(fields[key].split()[0]) / 1e3 for name, key in (("own_mb", "RssAnon"), ("mapped_mb", "RssFile"))}


class Filter:
    """The stages of omniview_mcl with `candidates=index`, step by step."""

    def __init__(self, map: ReferenceGraph, index: ReferenceIndex | None, scale: LengthScale, start: Any) -> None:
        self.map, self.index, self.scale = map, index, scale
        self.prior, self.motion = ParticlePrior(at=start), RotationTranslationRotation()
        self.candidates = IndexedCandidates()
        self.match, self.sensor = SelectiveMatch(), NearReferences()
        self.proposals, self.fusion = SimilarityProposals(), ImportanceResampling()
        stages = (self.prior, self.motion, self.candidates, self.match, self.sensor, self.proposals, self.fusion)
        self.ctx = {stage: Context(str(n), np.random.default_rng(n)) for n, stage in enumerate(stages)}
        for stage, ctx in self.ctx.items():
            stage.setup(ctx)
        self.compared = 0
        self.begin()

    def begin(self) -> None:
        """Go back to the first belief."""
        self.belief = self.prior.step(self._at(self.prior, 0), self.map, None, self.scale).belief

    def error(self, frame: Frame) -> float:
        """Distance of the estimate from the truth (m)."""
        pose = self.belief.estimate().pose
        return float(np.hypot(pose.x - frame.true[0], pose.y - frame.true[1]))

    def _at(self, stage: Any, number: int) -> Context:
        self.ctx[stage].tick = Tick(index=number, stamp=number, frame=number, first_of_log=number == 0)
        return self.ctx[stage]

    def step(self, frame: Frame) -> None:
        """One image."""
        number, moved, view, _ = frame
        belief = self.motion.step(self._at(self.motion, number), self.belief, moved, MeasuredNoise()).belief
        context = self._at(self.candidates, number)
        chosen = self.candidates.step(context, view, self.map, self.index, belief, self.scale).candidates
        alike = self.match.step(self._at(self.match, number), view, self.map, chosen).similarities
        out = self.sensor.step(self._at(self.sensor, number), alike, belief, self.map, moved, self.scale)
        proposed = self.proposals.step(self._at(self.proposals, number), out.field, self.map, self.scale).proposals
        self.belief = self.fusion.step(self._at(self.fusion, number), belief, out.likelihood, proposed).belief
        self.compared = len(alike.values)


def opened(folder: Path, references: int, found: dict[str, Any]) -> tuple[ReferenceGraph, ReferenceIndex | None]:
    """A map and its index, and how long it took to open them."""
    start = time.perf_counter()
    map = read_artifact(folder / f"{references}.omap")
    found["open_s"] = time.perf_counter() - start
    assert isinstance(map, ReferenceGraph)
    if not (folder / f"{references}.index").exists():
        return map, None
    start = time.perf_counter()
    index = read_artifact(folder / f"{references}.index")
    assert isinstance(index, ReferenceIndex)
    search_in(index)
    found["open_index_s"] = time.perf_counter() - start
    return map, index


def measured(folder: Path, references: int) -> dict[str, Any]:
    """All figures of one map, in this process."""
    drive, scale = views(folder, "drive", *RENDERED["drive"]), LengthScale(length_scale(folder))
    found: dict[str, Any] = {"references": references, **{f"before_{key}": mb for key, mb in resident().items()}}
    map, index = opened(folder, references, found)
    rows = np.linspace(0, len(drive) - 1, LOOKED_UP + 1).astype(int)
    looked_up = [SegmentHistograms(np.asarray(drive.features[row])) for row in rows]
    stage, match, ctx = IndexedCandidates(), SelectiveMatch(), Context("candidates")
    stage.setup(ctx)

    def look_up(view: SegmentHistograms) -> Any:
        return match.step(ctx, view, map, stage.step(ctx, view, map, index).candidates).similarities

    look_up(looked_up.pop())  # compiled
    calls = [lambda view=view: look_up(view) for view in looked_up]
    found["global_first_ms"], found["global_ms"] = milliseconds(calls), milliseconds(calls)
    found |= resident()
    way = frames(drive, TRACKED)
    x, y, heading = (float(v) for v in way[0].true)
    start = (x, y, heading, 0.3, 0.1)
    tracker, small = Filter(map, index, scale, start), Filter(*opened(folder, SIZES[0], {}), scale, start)
    for _ in range(2):  # what counts is the second time: then lists of cells are made, and the map's chunks are checked
        taken: dict[Filter, list[float]] = {tracker: [], small: []}
        for each in taken:
            each.begin()
        for frame in way:
            for each, times in taken.items():  # in turns, so that a noisy moment hits both
                times.append(milliseconds([lambda each=each, frame=frame: each.step(frame)]))
    of_smallest = [one / other for one, other in zip(taken[tracker], taken[small], strict=True)]
    found |= {"tracking_ms": statistics.median(taken[tracker][10:]), "compared": tracker.compared}
    found["tracking_ratio"] = statistics.median(of_smallest[10:])
    found |= {"tracked_error_m": tracker.error(way[-1]), **{f"end_{key}": mb for key, mb in resident().items()}}
    start = time.perf_counter()
    lost, errors = Filter(map, index, scale, "uniform"), []
    found["uniform_s"] = time.perf_counter() - start
    for frame in frames(drive, SEARCHED):
        lost.step(frame)
        errors.append(lost.error(frame))
    far = np.flatnonzero(np.array(errors) > 1.0)
    found["found_after_frames"] = int(far[-1]) + 1 if len(far) else 0
    return found


def length_scale(folder: Path) -> float:
    """The appearance length scale of the tour, which is used in all maps: the same views are near the robot."""
    file = folder / "length_scale.json"
    if not file.exists():
        stage, tour = AppearanceLengthScale(), views(folder, "tour", *RENDERED["tour"])
        file.write_text(json.dumps(stage.step(Context("length_scale"), tour).length_scale.metres))
    return float(json.loads(file.read_text()))


def prepare(folder: Path, references: int) -> None:
    """Make a map and its index, where they are not there."""
    file, index = folder / f"{references}.omap", folder / f"{references}.index"
    if not file.exists():
        tour, drive = (views(folder, name, *RENDERED[name]) for name in ("tour", "drive"))
        write_artifact(file, made(tour, drive, references))
    if references > IndexedCandidates.compare_all_up_to and not index.exists():
        map, start = read_artifact(file), time.perf_counter()
        assert isinstance(map, ReferenceGraph)
        stage, ctx = BuildReferenceIndex(), Context("reference_index")
        stage.setup(ctx)
        made_index = stage.step(ctx, map, BuildReferenceIndexState()).index
        assert made_index is not None
        write_artifact(index, made_index)
        print(f"index of {references} references built in {time.perf_counter() - start:.0f} s", file=sys.stderr)


def table(rows: list[dict[str, Any]]) -> str:
    """The figures as a page shows them."""
    shown = {
        "opening the map (s)": "{open_s:.2f}",
        "opening its index (s)": "{open_index_s:.2f}",
        "global step, first time (ms)": "{global_first_ms:.1f}",
        "global step (ms)": "{global_ms:.1f}",
        "tracking step (ms)": "{tracking_ms:.1f}",
        "the same over that of 1,000, in turns": "{tracking_ratio:.2f}",
        "references compared while tracking": "{compared}",
        "resident, own (MB)": "{end_own_mb:.0f}",
        "resident, mapped files (MB)": "{end_mapped_mb:.0f}",
        "uniform belief (s)": "{uniform_s:.1f}",
        "found after (frames)": "{found_after_frames}",
        "error at the end of tracking (m)": "{tracked_error_m:.2f}",
    }
    head = " | ".join(f"{row['references']:,}" for row in rows)
    lines = [f"| references | {head} |", "|---|" + "---|" * len(rows)]
    for what, form in shown.items():
        cells = [form.format(**{"open_index_s": float("nan"), **row}).replace("nan", "–") for row in rows]
        lines.append(f"| {what} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(rows: list[dict[str, Any]], file: Path) -> None:
    """Time and memory over the size of the map."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams |= {"svg.hashsalt": "omninav", "svg.fonttype": "none"}
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    sizes = [row["references"] for row in rows]
    for key, label in (("global_ms", "global step"), ("tracking_ms", "tracking step")):
        left.plot(sizes, [row[key] for row in rows], "o-", label=label)
    right.plot(sizes, [row["end_own_mb"] for row in rows], "o-", label="the process's own")
    right.plot(sizes, [row["end_mapped_mb"] for row in rows], "o-", label="mapped files, libraries above all")
    for axes, what in ((left, "ms, one thread"), (right, "resident MB")):
        axes.set(xscale="log", xlabel="references", ylabel=what, ylim=(0, None))
        axes.legend(frameon=False)
        axes.grid(alpha=0.3)
    figure.savefig(file, metadata={"Date": None})


def main() -> int:
    """Make maps, measure each in a process of its own, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--measure", type=int, help=argparse.SUPPRESS)
    words = parser.parse_args()
    words.folder.mkdir(parents=True, exist_ok=True)
    if words.measure:
        print(json.dumps(measured(words.folder, words.measure)))
        return 0
    rows = []
    length_scale(words.folder)
    for references in words.sizes:
        prepare(words.folder, references)
        command = [sys.executable, __file__, str(words.folder), "--measure", str(references)]
        single = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, env=single, stdout=subprocess.PIPE, text=True, check=True)
        rows.append(json.loads(done.stdout))
        print(json.dumps(rows[-1]), file=sys.stderr)
    print(table(rows))
    if words.plot:
        draw(rows, words.plot)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
