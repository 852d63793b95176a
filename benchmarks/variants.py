"""How well each variant does on several data sets, also in other light, and its costs: docs/which_variant.md.

    python benchmarks/variants.py --data FOLDER --level FOLDER --write docs/which_variant.md
    python benchmarks/variants.py --data FOLDER --costs --write docs/which_variant.md          # on a machine at rest

`--level`: a folder with the drives of benchmarks/game_level.py. Finished figures are kept in `--runs`, so that this can
be stopped and typed again. Time and memory (`--costs`) are of a process of its own, without a cache.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import omninav

SEEING_PANORAMAS = ("omninav", "omniview_mcl", "retrieval_mcl", "particle_cml_baseline", "plain_matching")
"""They learn a map and describe panoramas, whose light can be changed between tour and drive."""
MAPPED = (*SEEING_PANORAMAS, "topological_localisation")
LEARNING = ("omniview_cml", "particle_cml")
LIGHTS: Mapping[str, Mapping[str, float]] = {
    "as is": {},
    "dim": {"gamma": 1.4, "gain": 0.35},
    "warm": {"blue": 0.55, "red": 1.25},
    "side": {"gain": 0.775, "side": 0.677},
}
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"
COSTS_BEGIN, COSTS_END = "<!-- costs: begin -->", "<!-- costs: end -->"

Figures = dict[str, dict[str, dict[str, float]]]
"""By variant, then by data set and light: median, 90 % (m) and share lost once converged, each the median of seeds."""


@dataclass(frozen=True)
class DataSet:
    """Two drives through one place, and its occupancy grid."""

    name: str
    tour: str
    drive: str
    grid: str = "from_tour"


def data_sets(data: Path) -> list[DataSet]:
    """The recordings in a folder of sample data."""
    house, sussex, ants = (data / name for name in ("photoreal-house", "sussex-outdoor-route", "antworld-rendered"))
    return [
        DataSet("house", str(house / "tour.mcap"), str(house / "drive.mcap"), str(house / "map.yaml")),
        DataSet("Sussex", f"sussex_training:{sussex}", f"sussex_repeat:{sussex}:infomax_binary"),
        DataSet("AntWorld", f"antworld:{ants / 'ant1_route1'}", f"antworld:{ants / 'ant1_route2'}"),
    ]


def game_level(folder: Path) -> DataSet:
    """The drives that benchmarks/game_level.py wrote."""
    return DataSet("game level", str(folder / "tour.mcap"), str(folder / "drive.mcap"))


def simulated(folder: Path, world: str) -> DataSet:
    """A tour and a drive of the simulator, recorded into a folder."""
    for route in ("tour", "drive"):
        if not (folder / f"{route}.mcap").exists():
            process_memory("simulate", f"world={world}", f"route={route}", f"log={folder}/{route}.mcap")
    return DataSet(world, *(f"{folder}/{name}" for name in ("tour.mcap", "drive.mcap", "tour.grid/map.yaml")))


def words(variant: str, on: DataSet, light: str = "as is") -> list[str]:
    """What is typed to run a variant on a data set, the drive in another light."""
    if variant in LEARNING:
        return [f"variant={variant}", f"log=[{on.tour},{on.drive}]"]
    typed = [f"variant={variant}", f"tour={on.tour}", f"log={on.drive}"]
    typed += [f"grid={on.grid}"] if variant == "retrieval_mcl" else []
    if LIGHTS[light]:
        typed += ["perturbation=changed_light", "+wires.perturbation={panorama: unwarp.panorama}"]
        typed += ["wires.features.panorama=perturbation.panorama"]
        typed += [f"nodes.perturbation.{name}={value}" for name, value in LIGHTS[light].items()]
    return typed


def process_memory(*arguments: str) -> float:
    """Run a command line and return the process's largest memory in MB. Raises where it fails."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-m", "omninav", *arguments],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    assert process.stderr is not None
    said = process.stderr.read().decode()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"omninav {' '.join(arguments)}: {said[-500:]}")
    return usage.ru_maxrss / 1024


def errors(typed: list[str], seed: int, runs: Path) -> dict[str, float]:
    """Of one run: median, 90 % (m) and share lost, once converged; of all frames where it never was."""
    run = omninav.run(*typed, f"seed={seed}", f"runs={runs}", f"cache={runs / 'cache'}", "plots=none", progress=False)
    whole: Any = run.metrics
    after = whole["after_convergence"]
    found = after if after and after["position_error_m"] else whole
    shutil.rmtree(run.folder)
    error = found["position_error_m"]
    return {"error": error["median"], "p90": error["p90"], "lost": found["loss_rate"]}


def over_seeds(typed: list[str], seeds: int, runs: Path) -> dict[str, float]:
    """The median over seeds of each figure."""
    found = [errors(typed, seed, runs) for seed in range(seeds)]
    return {name: statistics.median(each[name] for each in found) for name in found[0]}


def costs(variant: str, on: DataSet, runs: Path) -> dict[str, float]:
    """Milliseconds per image (median) and megabytes, of a process of its own."""
    folder = runs / "cost"
    shutil.rmtree(folder, ignore_errors=True)
    memory = process_memory(*words(variant, on), "seed=0", f"hydra.run.dir={folder}", "cache=null")
    return {"step": json.loads((folder / "timing.json").read_text())["step"]["p50_ms"], "memory": memory}


def tables(figures: Figures, seeds: int) -> str:
    """Markdown: of each data set a row per variant and a column per light."""
    lines = [BEGIN]
    for on in dict.fromkeys(key.split(", ")[0] for by_set in figures.values() for key in by_set):
        lines += [f"| {on}: median / 90 % (m) | {' | '.join(LIGHTS)} |", f"|---{'|---:' * len(LIGHTS)}|"]
        for variant in (name for name in (*MAPPED, *LEARNING) if name in figures):
            by_set = figures[variant]
            shown = [cell(by_set[key]) if (key := f"{on}, {light}") in by_set else "" for light in LIGHTS]
            lines += [f"| `{variant}` | {' | '.join(shown)} |"] if any(shown) else []
        lines.append("")
    return "\n".join([*lines, f"Measured on {date.today()}, {seeds} seeds.", END])


def costs_table(measured: Mapping[str, list[dict[str, float]]]) -> str:
    """Markdown: the largest time and memory of each variant."""
    lines = [COSTS_BEGIN, "| variant | ms per image | MB |", "|---|---:|---:|"]
    for variant, of_sets in measured.items():
        step, memory = (max(found[name] for found in of_sets) for name in ("step", "memory"))
        lines.append(f"| `{variant}` | {step:.1f} | {memory:.0f} |")
    return "\n".join([*lines, "", f"Measured on {date.today()}, seed 0.", COSTS_END])


def replaced(page: str, shown: str) -> str:
    """The page with another table between the first and the last line of this one."""
    begin, end = shown.split("\n")[0], shown.split("\n")[-1]
    return page[: page.index(begin)] + shown + page[page.index(end) + len(end) :]


def cell(found: Mapping[str, float]) -> str:
    """A table's cell."""
    lost = f" ({100 * found['lost']:.0f} % lost)" if found["lost"] >= 0.005 else ""
    return f"{found['error']:.2f}" + (f" / {found['p90']:.2f}" if "p90" in found else "") + lost


def main() -> int:
    """Measure all, or the variants that are named, and write or print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--level", type=Path, help="folder of a game engine's level")
    parser.add_argument("--write", type=Path, help="page whose tables are replaced")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--runs", type=Path, default=Path("runs/variants"), help="where finished figures are kept")
    parser.add_argument("--costs", action="store_true", help="time and memory instead of errors")
    parser.add_argument("variants", nargs="*", default=[*MAPPED, *LEARNING])
    given = parser.parse_args()
    given.runs.mkdir(parents=True, exist_ok=True)
    kept = given.runs / "figures.json"
    figures: Figures = json.loads(kept.read_text()) if kept.exists() else {}
    sets = [*data_sets(given.data), *([game_level(given.level)] if given.level else [])]
    sets.append(simulated(given.runs, "home_store_demo"))
    if given.costs:
        shown = costs_table({name: [costs(name, on, given.runs) for on in sets] for name in given.variants})
    else:
        for on in sets:
            for variant in given.variants:
                for light in LIGHTS if variant in SEEING_PANORAMAS else ("as is",):
                    key, by_set = f"{on.name}, {light}", figures.setdefault(variant, {})
                    if key not in by_set:
                        print(f"{variant}: {key} …", file=sys.stderr, flush=True)
                        by_set[key] = over_seeds(words(variant, on, light), given.seeds, given.runs)
                        kept.write_text(json.dumps(figures, indent=1))
        shown = tables(figures, given.seeds)
    if given.write is None:
        print(shown)
    else:
        given.write.write_text(replaced(given.write.read_text(), shown))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
