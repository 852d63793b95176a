"""From variant=omniview_mcl to variant=omninav, rung by rung: the tables of docs/experiments/omninav_ladder.md.

    python benchmarks/omninav_ladder.py --data FOLDER --level FOLDER --write docs/experiments/omninav_ladder.md

Each rung alone upon omniview_mcl, then omninav, omninav with each rung taken out, and omninav with what was tried
besides. `--level` as in benchmarks/variants.py. Finished figures are kept in `--runs`.
"""

import argparse
import json
import sys
from datetime import date
from pathlib import Path

from variants import BEGIN, END, LIGHTS, Figures, cell, data_sets, game_level, over_seeds, words

RUNGS = {
    "grey world": (["nodes.features.grey_world=local"], ["nodes.features.grey_world=none"]),
    "many particles at the start": (
        [
            "nodes.prior.number=20000",
            "nodes.fusion.number=20000",
            "nodes.fusion.adapt=kld",
            "nodes.fusion.min_particles=2000",
        ],
        ["nodes.prior.number=5000", "nodes.fusion.number=5000", "nodes.fusion.adapt=none"],
    ),
    "many recovery particles": (
        ["nodes.fusion.recovery_share=0.3"],
        ["nodes.fusion.recovery_share=0.1"],
    ),
    "high background": (["nodes.sensor.background_quantile=0.95"], ["nodes.sensor.background_quantile=0.8"]),
    "fewer segments": (["nodes.match.penalty=three_quarters"], ["nodes.match.penalty=sqrt"]),
    "evidence sooner": (["nodes.sensor.independence_distance=0.5"], ["nodes.sensor.independence_distance=0.75"]),
}
"""By name: what is typed to take a rung upon omniview_mcl, and to take it out of omninav."""
TRIED = {
    "no brightness": ["nodes.features.value_bins=1"],
    "two bins of brightness": ["nodes.features.value_bins=2"],
    "eight bins of brightness": ["nodes.features.value_bins=8"],
    "sharper": ["nodes.sensor.contrast=5"],
    "softer": ["nodes.sensor.contrast=2"],
    "half the noise of motion": ["nodes.motion.translation_per_metre=0.05", "nodes.motion.rotation_per_metre=0.025"],
    "references reach farther": ["nodes.sensor.fade_distance=2"],
    "two neighbours": ["nodes.sensor.neighbours=2"],
}
"""Beside omninav."""


def conditions() -> dict[str, tuple[str, list[str]]]:
    """By the row's name: the variant and what is typed beside it."""
    rows = {"omniview_mcl": ("omniview_mcl", list[str]())}
    rows |= {f"omniview_mcl, {name}": ("omniview_mcl", rung) for name, (rung, _) in RUNGS.items()}
    rows["omninav"] = ("omninav", [])
    rows |= {f"omninav without {name}": ("omninav", back) for name, (_, back) in RUNGS.items()}
    return rows | {f"omninav, {name}": ("omninav", typed) for name, typed in TRIED.items()}


def tables(figures: Figures, lights: list[str], seeds: int) -> str:
    """Markdown: of each data set a row per condition and a column per light."""
    lines = [BEGIN]
    for on in dict.fromkeys(key.split(", ")[0] for by_set in figures.values() for key in by_set):
        lines += [f"| {on} | {' | '.join(lights)} |", f"|---{'|---:' * len(lights)}|"]
        for name in conditions():
            by_set = figures.get(name, {})
            shown = [cell(by_set[key]) if (key := f"{on}, {light}") in by_set else "" for light in lights]
            lines += [f"| {name} | {' | '.join(shown)} |"] if any(shown) else []
        lines.append("")
    return "\n".join([*lines, f"Measured on {date.today()}, {seeds} seeds.", END])


def main() -> None:
    """Measure what is missing, and write or print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--level", type=Path, help="folder of a game engine's level")
    parser.add_argument("--write", type=Path, help="page whose tables are replaced")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--lights", nargs="+", default=list(LIGHTS), choices=list(LIGHTS))
    parser.add_argument("--runs", type=Path, default=Path("runs/ladder"), help="where finished figures are kept")
    given = parser.parse_args()
    given.runs.mkdir(parents=True, exist_ok=True)
    kept = given.runs / "figures.json"
    figures: Figures = json.loads(kept.read_text()) if kept.exists() else {}
    for on in [*data_sets(given.data), *([game_level(given.level)] if given.level else [])]:
        for name, (variant, typed) in conditions().items():
            for light in given.lights:
                key, by_set = f"{on.name}, {light}", figures.setdefault(name, {})
                if key not in by_set:
                    print(f"{name}: {key} …", file=sys.stderr, flush=True)
                    by_set[key] = over_seeds([*words(variant, on, light), *typed], given.seeds, given.runs)
                    kept.write_text(json.dumps(figures, indent=1))
    shown = tables(figures, given.lights, given.seeds)
    if given.write is None:
        print(shown)
    else:
        page = given.write.read_text()
        given.write.write_text(page[: page.index(BEGIN)] + shown + page[page.index(END) + len(END) :])


if __name__ == "__main__":
    main()
