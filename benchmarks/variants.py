"""What each variant costs and how well it does on four data sets: the table of docs/which_variant.md.

    python benchmarks/variants.py --data FOLDER --write docs/which_variant.md

Every run is a process of its own, and reads nothing from a cache.
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

MAPPED = ("plain_matching", "omniview_mcl", "retrieval_mcl", "particle_cml_baseline", "topological_localisation")
LEARNING = ("omniview_cml", "particle_cml")
BEGIN, END = "<!-- measured: begin -->", "<!-- measured: end -->"


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


def simulated(folder: Path, world: str) -> DataSet:
    """A tour and a drive of the simulator, recorded into a folder."""
    for route in ("tour", "drive"):
        if not (folder / f"{route}.mcap").exists():
            omninav("simulate", f"world={world}", f"route={route}", f"log={folder}/{route}.mcap")
    return DataSet(
        f"simulated {world}", *(f"{folder}/{name}" for name in ("tour.mcap", "drive.mcap", "tour.grid/map.yaml"))
    )


def words(variant: str, on: DataSet) -> list[str]:
    """What is typed to run a variant on a data set."""
    if variant in LEARNING:
        return [f"variant={variant}", f"log=[{on.tour},{on.drive}]"]
    grid = [f"grid={on.grid}"] if variant == "retrieval_mcl" else []
    return [f"variant={variant}", f"tour={on.tour}", f"log={on.drive}", *grid]


def omninav(*arguments: str) -> float:
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


def measured(variant: str, on: DataSet, seeds: int, runs: Path) -> dict[str, float]:
    """Medians over the seeds: error (m) and share lost once converged, milliseconds per image, megabytes."""
    found: list[dict[str, float]] = []
    for seed in range(seeds):
        folder = runs / f"{variant} {on.name} {seed}".replace(" ", "_")
        shutil.rmtree(folder, ignore_errors=True)
        own = [f"seed={seed}", f"hydra.run.dir={folder}", "cache=null"]  # every stage runs
        memory = omninav(*words(variant, on), *own)
        metrics, timing = (json.loads((folder / name).read_text()) for name in ("metrics.json", "timing.json"))
        after = metrics["after_convergence"]
        figures = {"error": after["position_error_m"]["median"], "lost": after["loss_rate"]}
        found.append(figures | {"step": timing["step"]["p50_ms"], "memory": memory})
    return {name: statistics.median(each[name] for each in found) for name in found[0]}


def table(figures: Mapping[str, Mapping[str, Mapping[str, float]]], seeds: int) -> str:
    """Markdown: a row per variant; its error on each data set, and over them its largest time and memory."""
    sets = list(dict.fromkeys(name for by_set in figures.values() for name in by_set))
    lines = [
        f"| variant | {' | '.join(f'{name} (m)' for name in sets)} | ms per image | MB |",
        f"|---{'|---:' * (len(sets) + 2)}|",
    ]
    for variant, by_set in figures.items():
        errors = [_error(by_set[name]) if name in by_set else "" for name in sets]
        step, memory = (max(found[key] for found in by_set.values()) for key in ("step", "memory"))
        lines.append(f"| `{variant}` | {' | '.join(errors)} | {step:.1f} | {memory:.0f} |")
    seeds_said = "seed 0" if seeds == 1 else f"medians over {seeds} seeds"
    return "\n".join([BEGIN, *lines, "", f"Measured on {date.today()}, {seeds_said}.", END])


def _error(found: Mapping[str, float]) -> str:
    return f"{found['error']:.2f}" + (f" ({100 * found['lost']:.0f} % lost)" if found["lost"] >= 0.005 else "")


def main() -> int:
    """Measure all, or the variants that are named, and write or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--write", type=Path, help="page whose table is replaced")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--runs", type=Path, default=Path("runs/variants"), help="where finished figures are kept")
    parser.add_argument("variants", nargs="*", default=[*MAPPED, *LEARNING])
    given = parser.parse_args()
    kept = given.runs / "figures.json"
    figures: dict[str, dict[str, dict[str, float]]] = json.loads(kept.read_text()) if kept.exists() else {}
    for on in [simulated(given.runs, "home_store_demo"), *data_sets(given.data)]:
        for variant in given.variants:
            if on.name in figures.get(variant, {}):
                continue
            print(f"{variant} on {on.name} …", file=sys.stderr, flush=True)
            figures.setdefault(variant, {})[on.name] = measured(variant, on, given.seeds, given.runs)
            kept.write_text(json.dumps(figures, indent=1))
    shown = table(figures, given.seeds)
    if given.write is None:
        print(shown)
    else:
        page = given.write.read_text()
        given.write.write_text(page[: page.index(BEGIN)] + shown + page[page.index(END) + len(END) :])
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
