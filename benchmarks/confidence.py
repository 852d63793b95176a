"""Whether a localisation knows when it is lost, and what smoothing gains: the tables of docs/experiments/confidence.md.

    python benchmarks/confidence.py --data FOLDER --runs FOLDER --seeds 2 3 4 --write docs/experiments/confidence.md

Every recording as it is, in three kinds of changed light, and with a kidnapping; a world of the simulator where it was
recorded into the folder of runs. A run that is there is not made again.
"""

import argparse
import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from light import LIGHTS
from variants import DataSet, data_sets, simulated

import omninav
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.plane.smoothing import smoothed, smoothed_with_lag
from omninav.stages.geometry.probability.calibration import (
    area_under_roc,
    expected_calibration_error,
    reliability,
    squared_mahalanobis,
)

Array = npt.NDArray[np.float64]
CUTS, KIDNAPPED_AT = {"house": (45, 90), "Sussex": (40, 90), "AntWorld": (150, 330)}, (40, 85)
"""Kidnappings: after so many images it goes on with which, and in worlds of the simulator."""
LOST_M, WITHIN_M, WITHIN_DEG = 2.5, 0.5, 10.0
TRUTH_DEG = {"Sussex": 20.0}
"""Tolerance in heading where the true one is known to ten degrees only."""
LAG, WINDOW = 5, 50
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


@dataclass(frozen=True)
class Frames:
    """The frames of one run with truth and estimate; a row each."""

    place: str
    condition: str
    estimate: Array
    truth: Array
    covariance: Array
    confidence: Array
    motion: Array

    @property
    def errors(self) -> Array:
        return position_errors(self.estimate, self.truth)

    @property
    def right(self) -> npt.NDArray[np.bool_]:
        limit = TRUTH_DEG.get(self.place, WITHIN_DEG)
        return np.asarray((self.errors <= WITHIN_M) & (heading_errors_deg(self.estimate, self.truth) <= limit))


def run(variant: str, on: DataSet, condition: str, seed: int, runs: Path) -> Frames:
    """Make a run, or take the one that is there."""
    folder = runs / f"{variant} {on.name} {condition} {seed}".replace(" ", "_")
    if not (folder / "report.html").exists():
        words = ["plots=none", f"cache={runs / 'cache'}"]
        if condition == "kidnapped":
            first, then = CUTS.get(on.name, KIDNAPPED_AT)
            words.append(f"cuts=[[{first},{then}]]")
        elif LIGHTS[condition]:
            words += ["+wires.perturbation={panorama: unwarp.panorama}", "perturbation=changed_light"]
            words += ["wires.features.panorama=perturbation.panorama"]
            words += [f"nodes.perturbation.{key}={value}" for key, value in LIGHTS[condition].items()]
        grid = {"grid": on.grid} if variant == "retrieval_mcl" else {}
        omninav.run(variant, *words, folder=folder, progress=False, tour=on.tour, log=on.drive, seed=seed, **grid)
    with (folder / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))

    def columns(*names: str) -> Array:
        return np.array([[float(row[name] or "nan") for name in names] for row in rows])

    def poses(name: str, angle: str = "heading") -> Array:
        return columns(*(f"{name}_{axis}" for axis in ("x", "y", angle)))

    entries = ("xx", "xy", "xh", "xy", "yy", "yh", "xh", "yh", "hh")
    covariance = columns(*(f"covariance_{entry}" for entry in entries)).reshape(-1, 3, 3)
    known = np.isfinite(poses("truth")).all(axis=1) & np.isfinite(poses("estimate")).all(axis=1)
    parts = poses("estimate"), poses("truth"), covariance, columns("confidence")[:, 0]
    motion = np.nan_to_num(poses("motion", "turn"))
    return Frames(on.name, condition, *(part[known] for part in parts), motion[known])


def share(value: float | None) -> str:
    """A share as text."""
    return "–" if value is None else f"{value:.3f}"


def told(runs: Sequence[Frames]) -> str:
    """Cells of the first table: of all frames of some runs."""
    right, lost = np.concatenate([each.right for each in runs]), np.concatenate([each.errors > LOST_M for each in runs])
    confidence = np.concatenate([each.confidence for each in runs])
    squares = np.concatenate(
        [squared_mahalanobis((r.estimate - r.truth)[:, :2], r.covariance[:, :2, :2]) for r in runs]
    )
    squares = squares[np.isfinite(squares)]
    within = [float((squares <= limit).mean()) for limit in (1.386, 5.991)]
    cells = (
        f"{100 * right.mean():.0f}",
        f"{100 * lost.mean():.0f}",
        share(area_under_roc(-confidence, ~right)),
        share(area_under_roc(-confidence, lost)),
        share(expected_calibration_error(reliability(confidence, right))),
        *(f"{100 * covered:.0f}" for covered in within),
        f"{np.median(squares):.1f}",
    )
    return " | ".join(cells)


def after_kidnapping(each: Frames) -> tuple[float, float, float, float] | None:
    """Kidnapped run: images until it is right again, until the confidence is below a half (all of them where it
    never is), its mean meanwhile, and images that are right until it is above a half again; None: found at once."""
    cut, wrong = CUTS.get(each.place, KIDNAPPED_AT)[0], ~each.right
    if not wrong[cut : cut + 3].any():
        return None
    begin = cut + int(wrong[cut:].argmax())
    length = int(np.append(~wrong[begin:], True).argmax())
    meanwhile, then = each.confidence[begin : begin + length], each.confidence[begin + length :]
    doubted = int(np.append(meanwhile < 0.5, True).argmax())
    trusted = float(np.append(then >= 0.5, True).argmax()) if len(then) else np.nan
    return length, doubted, float(meanwhile.mean()), trusted


def by_smoothing(runs: Sequence[Frames], some: Sequence[Frames]) -> str:
    """Cells of the second table: median / 90 % (share lost) of the filter, in the end, and `some` a few images late."""
    given = [(each.estimate, each.covariance, each.confidence, each.motion) for each in runs]
    late = [smoothed_with_lag(r.estimate, r.covariance, r.confidence, r.motion, LAG, WINDOW) for r in some]
    found = ((runs, [r.estimate for r in runs]), (runs, [smoothed(*parts) for parts in given]), (some, late))
    cells = []
    for of, poses in found:
        errors = np.concatenate([position_errors(each, r.truth) for each, r in zip(poses, of, strict=True)])
        lost = 100 * (errors > LOST_M).mean()
        cells.append(f"{np.median(errors):.2f} / {np.quantile(errors, 0.9):.2f} ({lost:.0f} %)")
    return " | ".join(cells)


def tables(variant: str, runs: Mapping[int, Sequence[Frames]]) -> list[str]:
    """Markdown lines for one variant."""
    every = [each for of_seed in runs.values() for each in of_seed]
    places = list(dict.fromkeys(each.place for each in every))
    conditions = list(dict.fromkeys(each.condition for each in every))
    columns = ("right (%)", "lost (%)", "AUROC, wrong", "AUROC, lost", "ECE")
    columns += ("in 50 % ellipse (%)", "in 95 % ellipse (%)", "squared error, median")
    lines = [f"### `{variant}`", "", f"| frames of | {' | '.join(columns)} |", f"|---{'|---:' * len(columns)}|"]
    groups = {place: [r for r in every if r.place == place] for place in places}
    groups |= {name: [r for r in every if r.condition == name] for name in conditions}
    lines += [f"| {name} | {told(some)} |" for name, some in groups.items()]
    lines += [f"| seed {seed} | {told(of_seed)} |" for seed, of_seed in runs.items()]
    lines += [f"| **all** | {told(every)} |", ""]
    lines += ["| kidnapped | images wrong | until below 0.5 | mean meanwhile | right until above 0.5 |"]
    lines += ["|---|---:|---:|---:|---:|"]
    for place in places:
        some = [after_kidnapping(r) for r in every if (r.place, r.condition) == (place, "kidnapped")]
        if found := [figures for figures in some if figures]:
            means = np.ma.masked_invalid(found).mean(axis=0).filled(np.nan)
            lines.append("| {} | {:.1f} | {:.1f} | {:.2f} | {:.1f} |".format(place, *means).replace("nan", "–"))
    lines.append("")
    first, *_ = runs
    lines += [f"| | filter | smoothed in the end | {LAG} images late, seed {first} |", "|---|---:|---:|---:|"]
    for place in places:
        for name in conditions:
            some = [r for r in every if (r.place, r.condition) == (place, name)]
            late = [r for r in runs[first] if (r.place, r.condition) == (place, name)]
            lines.append(f"| {place}, {name} | {by_smoothing(some, late)} |")
    return [*lines, ""]


def main() -> None:
    """Print the tables, or write them into a page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--runs", type=Path, required=True, help="folder for the runs")
    parser.add_argument("--variants", nargs="+", default=["omniview_mcl", "omninav"])
    parser.add_argument("--worlds", nargs="*", default=["home_store_demo", "office"], help="of the simulator")
    parser.add_argument("--seeds", nargs="+", type=int, default=[2, 3, 4])
    parser.add_argument("--write", type=Path, help="the page that holds the tables")
    given = parser.parse_args()
    sets = [*data_sets(given.data)]
    for world in given.worlds:
        place = given.runs / world
        place.mkdir(parents=True, exist_ok=True)
        sets.append(simulated(place, world))
    lines = [BEGIN]
    for variant in given.variants:
        found = {
            seed: [run(variant, on, condition, seed, given.runs) for on in sets for condition in (*LIGHTS, "kidnapped")]
            for seed in given.seeds
        }
        lines += tables(variant, found)
    text = "\n".join([*lines, END])
    if given.write is None:
        print(text)
        return
    before, _, rest = given.write.read_text().partition(BEGIN)
    given.write.write_text(before + text + rest.partition(END)[2])


if __name__ == "__main__":
    main()
