"""What straightened maps and visual turns are worth in map learning: docs/experiments/cml_straightened.md.

    python benchmarks/cml_straightened.py --data FOLDER [--seeds 3] [--runs FOLDER] [VARIANT …]

Each run is a process of its own. Finished ones are kept in the folder of runs. Cells: median / 90 % of the position
error (m) over the last log once converged, and the share of all its frames that is lost, in the order of the seeds.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path

from variants import DataSet, data_sets, omninav

TURNS_OFF, LEFT_BENT = "nodes.visual_turn.max_sigma_deg=0", "nodes.straightened.max_distance=0"
RUNGS: Mapping[str, tuple[str, ...]] = {
    "odometry's turns, map left bent": (TURNS_OFF, LEFT_BENT),
    "map straightened": (TURNS_OFF,),
    "turns seen": (LEFT_BENT,),
    "both (default)": (),
}
LOST_M = {"house": 2.5}
"""Metres above which an estimate is lost; outdoors 1."""


def logs(on: DataSet) -> list[list[str]]:
    """The sequences of drives of a data set: two, and in AntWorld the first one once more."""
    twice = [on.tour, on.drive]
    return [twice, [*twice, on.tour]] if on.name == "AntWorld" else [twice]


def cell(folder: Path) -> str:
    """The figures of a finished run."""
    last = json.loads((folder / "metrics.json").read_text())["logs"][-1]
    error = (last["after_convergence"] or {}).get("position_error_m")
    shown = "not found" if error is None else f"{error['median']:.2f} / {error['p90']:.2f}"
    return shown + (f", {100 * last['loss_rate']:.0f} % lost" if last["loss_rate"] >= 0.005 else "")


def main() -> int:
    """Run what is missing and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--runs", type=Path, default=Path("runs/cml_straightened"))
    parser.add_argument("variants", nargs="*", default=["omniview_cml", "particle_cml"])
    given = parser.parse_args()
    for variant in given.variants:
        for on in data_sets(given.data):
            for drives in logs(on):
                print(f"\n{variant}, {on.name}, {len(drives)} logs\n")
                for name, words in RUNGS.items():
                    cells = []
                    for seed in range(1 if on.name == "house" else given.seeds):
                        rung = list(RUNGS).index(name)
                        folder = given.runs.absolute() / f"{variant}_{on.name}_{len(drives)}_{rung}_{seed}"
                        if not (folder / "metrics.json").exists():
                            said = [f"seed={seed}", f"lost_m={LOST_M.get(on.name, 1.0)}", f"hydra.run.dir={folder}"]
                            omninav(f"variant={variant}", f"log=[{','.join(drives)}]", *said, *words)
                        cells.append(cell(folder))
                    print(f"| {name} | {'; '.join(cells)} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
