"""What a calibrated likelihood is worth: the tables of docs/experiments/retrieval_mcl_calibrated.md.

    python benchmarks/likelihood.py --data FOLDER                 # recordings, start anywhere
    python benchmarks/likelihood.py --office 21                   # simulated office of that seed, days 1 to 3
    python benchmarks/likelihood.py --office 21 --kidnapped       # carried some 25 m after 30 images
    python benchmarks/likelihood.py --office 21 --tracked         # a start that is known

Seed 11 is the office of the experiments. Errors in metres once converged, of each run: median / 90 % / largest.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from variants import data_sets

import omninav

WAYS: Mapping[str, Mapping[str, list[str]]] = {
    "retrieval_mcl": {
        "calibrated": [],
        "the paper's": ["likelihood=power", "fusion=uniform_recovery", "proposals=free_space"],
        "calibrated, augmented recovery": ["fusion=augmented_recovery"],
    },
    "omniview_mcl": {"power": [], "calibrated": ["likelihood=calibrated"]},
}
WINDOW = ["unwarp=window", "+artifacts.map.nodes.unwarp.directions=8"]


def told(variant: str, words: list[str], seeds: int, drive: Mapping[str, str]) -> str:
    """The cells of a row: lost, error, images until one mode, images until found again, of each seed."""
    lost, error, unimodal, recovered = [], [], [], []
    for seed in range(seeds):
        metrics: Any = omninav.run(variant, *words, "plots=none", progress=False, seed=seed, **drive).metrics
        after = metrics["after_convergence"]
        found = after["position_error_m"] or metrics["position_error_m"]
        share = metrics["loss_rate"] if after["loss_rate"] is None else after["loss_rate"]
        lost.append(f"{100 * share:.1f}")
        error.append(f"{found['median']:.2f} / {found['p90']:.2f} / {found['max']:.1f}")
        unimodal.append(str(metrics["success"]["unimodal_after_frames"]))
        recovered.append(str(metrics["success"].get("recovered_after_frames")))
    return " | ".join(", ".join(cell) for cell in (lost, error, unimodal, recovered))


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, help="folder of the sample recordings")
    parser.add_argument("--office", type=int, help="seed of a simulated office")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--tracked", action="store_true")
    parser.add_argument("--kidnapped", action="store_true")
    parser.add_argument("--variant", choices=[*WAYS], default="retrieval_mcl")
    parser.add_argument("--ways", nargs="+", default=["calibrated", "the paper's"])
    given = parser.parse_args()
    print("| drive | likelihood | lost (%) | error (m) | images until one mode | found again after |")
    print("|---|---|---|---|---|---|")
    retrieval = given.variant == "retrieval_mcl"
    ways = {name: words for name, words in WAYS[given.variant].items() if name in given.ways or not retrieval}
    start = ["start=truth"] if given.tracked else []
    if given.data:
        for on in data_sets(given.data):
            drive = {"tour": on.tour, "log": on.drive} | ({"grid": on.grid} if retrieval else {})
            for name, words in ways.items():
                print(
                    f"| {on.name} | {name} | {told(given.variant, [*words, *start], given.seeds, drive)} |", flush=True
                )
    if given.office is not None:
        common = ["world=office", f"world.seed={given.office}", "route=drive", "world.timing.images=1.0"]
        common += ["tour_settings.route=tour", *start, *(["cuts=[[30,90]]"] if given.kidnapped else [])]
        common += ["+artifacts.map.nodes.mapping.min_distance_m=0.95"] if retrieval else []
        for camera, seen in {"window": WINDOW, "panorama": []}.items() if retrieval else [("panorama", [])]:
            for day in (1,) if given.kidnapped else (1, 2, 3):
                for name, words in ways.items():
                    cells = told(given.variant, [*common, f"day={day}", *seen, *words], given.seeds, {})
                    print(f"| office {given.office}, day {day}, {camera} | {name} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
