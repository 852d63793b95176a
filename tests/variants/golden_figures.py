"""A short run of every variant on small data, and the figures of it that are kept in golden.json."""

import json
import os
from collections.abc import Iterator
from contextlib import chdir
from pathlib import Path
from typing import Any

import cv2

from omninav.pipeline.cli.main import main
from omninav.stages.recordings.opening import open_recording

DATA = Path(__file__).resolve().parents[1] / "data"
PEERS = Path(__file__).resolve().parents[2] / "benchmarks" / "peers"
GOLDEN = Path(__file__).with_name("golden.json")
TOUR, DRIVE = f"tour={DATA / 'tour.mcap'}", f"log={DATA / 'drive.mcap'}"
MAPPED = f"log={DATA / 'tour.mcap'}"
BOTH = f"log=[{DATA / 'tour.mcap'},{DATA / 'drive.mcap'}]"
EVERY_SECOND, EVERY_FOURTH = "nodes.source.stride=2", "nodes.source.stride=4"
SMALL_CAMERA = (
    "world.timing.images=1",
    "world.camera.image={width: 280, height: 210}",
    "world.camera.K=[[217.4375,0,139.5],[0,217.4375,104.5],[0,0,1]]",
    "world.camera.mask={inner_radius_px: 15, outer_radius_px: 104}",
)

GOAL_FRAME = 14

RUNS: dict[str, tuple[str, ...]] = {
    "homing": (*SMALL_CAMERA, "nodes.source.seconds=4"),
    "homing_as_printed": (*SMALL_CAMERA, "nodes.source.seconds=4"),
    "homing_field": ("world=home_store_demo", *SMALL_CAMERA, "nodes.field.rings=2"),
    "landmark_nav": (TOUR, "world=home_store_demo", *SMALL_CAMERA, "goal=goal.png", "nodes.source.seconds=4"),
    "matched_pairs": (MAPPED, "nodes.matches.pairs=4"),
    "omninav": (TOUR, DRIVE),
    "omninav_map": (MAPPED,),
    "omniview_cml": (BOTH, "nodes.novelty_threshold.views=30"),
    "omniview_cml_as_printed": (BOTH, "nodes.novelty_threshold.views=30"),
    "omniview_cml_as_printed_map": (MAPPED, "nodes.novelty_threshold.views=30"),
    "omniview_cml_map": (MAPPED, "nodes.novelty_threshold.views=30"),
    "omniview_mcl": (TOUR, DRIVE),
    "omniview_mcl_as_printed": (TOUR, DRIVE),
    "omniview_mcl_as_printed_map": (MAPPED,),
    "omniview_mcl_map": (MAPPED,),
    "particle_cml": (BOTH, "nodes.novelty_threshold.views=30", "nodes.source.stop=40"),
    "particle_cml_as_printed": (BOTH, "nodes.novelty_threshold.views=30", "nodes.source.stop=40"),
    "particle_cml_as_printed_map": (MAPPED, "nodes.novelty_threshold.views=30"),
    "particle_cml_baseline": (TOUR, DRIVE, EVERY_SECOND),
    "particle_cml_baseline_map": (MAPPED, EVERY_SECOND),
    "particle_cml_map": (MAPPED, "nodes.novelty_threshold.views=30"),
    "peer": (TOUR, DRIVE, f'command="python {PEERS / "nearest_image.py"}"'),
    "plain_matching": (TOUR, DRIVE),
    "retrieval_mcl": (TOUR, DRIVE, f"grid={DATA / 'map.yaml'}", EVERY_SECOND),
    "retrieval_mcl_as_printed": (TOUR, DRIVE, f"grid={DATA / 'map.yaml'}", EVERY_FOURTH),
    "retrieval_mcl_as_printed_map": (MAPPED, EVERY_FOURTH),
    "retrieval_mcl_map": (MAPPED, EVERY_SECOND),
    "simulate": (
        "world=home_store_demo",
        *SMALL_CAMERA,
        "world.routes.drive.waypoints=[[2.4,1.5],[5.0,1.5]]",
        "log=out.mcap",
    ),
    "topological_localisation": (TOUR, DRIVE, EVERY_SECOND),
    "topological_localisation_as_printed": (TOUR, DRIVE, EVERY_SECOND),
    "topological_nav": ("world=home_store_demo", *SMALL_CAMERA, "goal=3", "nodes.source.seconds=3"),
    "topological_nav_as_printed": ("world=home_store_demo", *SMALL_CAMERA, "goal=3", "nodes.source.seconds=3"),
    "topological_nav_map": (MAPPED, EVERY_SECOND),
    "topological_nav_as_printed_map": (MAPPED, EVERY_SECOND),
    "two_views": (),
    "wander": (*SMALL_CAMERA, "nodes.source.seconds=4"),
}
"""Variant -> what is typed after variant=NAME; NAME_map -> … after `map variant=NAME`."""


def started_by(variant: str) -> tuple[str, ...]:
    """Gives the words that run a variant, or make its map."""
    if variant == "simulate":
        return ("simulate", *RUNS[variant])
    of = variant.removesuffix("_map")
    return (*(["map"] if of != variant else []), f"variant={of}", *RUNS[variant])


def measured(variant: str, place: Path, cache: Path) -> dict[str, Any]:
    """The figures of a variant that was run in this folder."""
    place.mkdir(parents=True, exist_ok=True)
    kept = ("runs=runs", f"cache={cache}", "seed=0")
    words = started_by(variant) if variant == "simulate" else (*started_by(variant), *kept)
    write_goal(place)
    with chdir(place):
        code = main(words)
    assert code == 0, f"omninav {' '.join(words)} ended with {code}"
    if variant == "simulate":
        return _figures_of_log(place / "out.mcap")
    run = place / "runs" / "latest"
    manifest = json.loads((run / "manifest.json").read_text())
    content = {"metrics": json.loads((run / "metrics.json").read_text()), "facts": manifest["facts"]}
    found = {name: value for name, value in sorted(_figures(content)) if "cpu_" not in name}  # which no run repeats
    return {"ticks": manifest["ticks"], **found}


def write_goal(place: Path) -> tuple[float, float]:
    """Write an image of the drive as goal.png into a folder, and say where it was taken (m)."""
    recording = open_recording(str(DATA / "drive.mcap"))
    cv2.imwrite(str(place / "goal.png"), recording.image(GOAL_FRAME))
    x, y, _ = recording.truth[GOAL_FRAME]
    return float(x), float(y)


def _figures_of_log(log: Path) -> dict[str, Any]:
    recording = open_recording(str(log))
    image, end = recording.image(0), recording.truth[-1]
    assert image is not None
    figures = {"images": len(recording.stamps), "grey": float(image.mean()), "x": float(end[0]), "y": float(end[1])}
    return dict(_figures(figures))


def _figures(content: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Every number and word by its path; of a distribution its median, of lists nothing."""
    if isinstance(content, dict):
        for key, value in content.items():
            if "median" not in content or key == "median":
                yield from _figures(value, (*path, key))
    elif not isinstance(content, list):
        yield ".".join(path), float(f"{content:.6g}") if isinstance(content, float) else content


def read_golden() -> dict[str, dict[str, Any]]:
    """What golden.json holds, by variant."""
    return json.loads(GOLDEN.read_text()) if GOLDEN.exists() else {}


def write_golden(figures: dict[str, dict[str, Any]]) -> None:
    """Write golden.json whole."""
    half = GOLDEN.with_suffix(".part")
    half.write_text(json.dumps(dict(sorted(figures.items())), indent=1) + "\n")
    os.replace(half, GOLDEN)
