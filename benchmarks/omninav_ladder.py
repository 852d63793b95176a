"""From variant=omniview_mcl to variant=omninav, rung by rung: the tables of docs/experiments/omninav_ladder.md.

    python benchmarks/omninav_ladder.py --data FOLDER --level FOLDER --write docs/experiments/omninav_ladder.md

Each rung alone upon omniview_mcl, all of them (omninav), omninav with each rung taken out, and omninav with what was
tried besides. The stages of the filter are called one after the other, as the graph does, on similarities that were
computed once for all seeds and are kept in `--runs`; odometry is that of seed 0. `--level` as in variants.py.
"""

import argparse
import csv
import json
import statistics
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from light import in_light
from variants import BEGIN, END, LIGHTS, DataSet, cell, data_sets, game_level, replaced, words

import omninav
from omninav import Context
from omninav.pipeline import Tick
from omninav.stages.features.hsv_histogram import HsvHistogram
from omninav.stages.fusion.importance_resampling import ImportanceResampling
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.geometry.appearance.length_scale import length_scale
from omninav.stages.geometry.plane.pose_errors import first_settled, heading_errors_deg, position_errors
from omninav.stages.mapping.reference_graph import LearnReferenceGraph, LearnReferenceGraphState
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.metrics.trajectory_errors import pose_errors
from omninav.stages.motion.rotation_translation_rotation import RotationTranslationRotation
from omninav.stages.recordings.opening import open_recording
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.sensor.similarity_proposals import SimilarityProposals
from omninav.stages.unwarp.table import PanoramaTable
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]
Settings = Mapping[str, Mapping[str, Any]]
"""Parameters by node."""

PARTICLES = {"prior": {"number": 20000}, "fusion": {"number": 20000, "adapt": "kld", "min_particles": 2000}}
RUNGS: Mapping[str, Settings] = {
    "grey world": {"features": {"grey_world": "local"}},
    "more particles at the start": PARTICLES,
    "more recovery particles": {"fusion": {"recovery_share": 0.3}},
    "a higher background": {"sensor": {"background_quantile": 0.95}},
    "fewer segments": {"match": {"penalty": "three_quarters"}},
    "evidence sooner": {"sensor": {"independence_distance": 0.5}},
}
TRIED: Mapping[str, Settings] = {
    "no bins of brightness": {"features": {"value_bins": 1}},
    "two bins of brightness": {"features": {"value_bins": 2}},
    "eight bins of brightness": {"features": {"value_bins": 8}},
    "a sharper likelihood": {"sensor": {"contrast": 5.0}},
    "a softer likelihood": {"sensor": {"contrast": 2.0}},
    "half the noise of motion": {"motion": {"translation_per_metre": 0.05, "rotation_per_metre": 0.025}},
    "references reach farther": {"sensor": {"fade_distance": 2.0}},
    "two neighbours": {"sensor": {"neighbours": 2}},
}
NODES = {
    "features": HsvHistogram,
    "match": SelectiveMatch,
    "prior": ParticlePrior,
    "motion": RotationTranslationRotation,
    "sensor": NearReferences,
    "proposals": SimilarityProposals,
    "fusion": ImportanceResampling,
}


def merged(*settings: Settings) -> Settings:
    """Of each node the parameters of all."""
    return {node: {name: value for one in settings for name, value in one.get(node, {}).items()} for node in NODES}


def conditions() -> dict[str, Settings]:
    """By the row's name."""
    whole = list(RUNGS.values())
    rows: dict[str, Settings] = {"omniview_mcl": merged()}
    rows |= {f"omniview_mcl with {name}": merged(rung) for name, rung in RUNGS.items()}
    rows["omninav"] = merged(*whole)
    rows |= {
        f"omninav without {name}": merged(*(one for one in whole if one is not rung)) for name, rung in RUNGS.items()
    }
    return rows | {f"omninav with {name}": merged(*whole, more) for name, more in TRIED.items()}


@dataclass(frozen=True)
class Views:
    """Panoramas of a drive, and where they were taken: (N, 3)."""

    pixels: list[Any]
    truth: Array


class Drives:
    """A data set: its views, and the map and similarities by the settings that they depend on."""

    def __init__(self, on: DataSet, kept: Path) -> None:
        self.on, self._kept = on, kept / on.name.replace(" ", "_")
        self._kept.mkdir(parents=True, exist_ok=True)
        self._views: dict[str, Views] = {}
        self._maps: dict[str, tuple[ReferenceGraph, LengthScale]] = {}
        self.motions = self._motions()

    def truth(self) -> Array:
        """True poses at the images that the filter sees."""
        return self.views(self.on.drive).truth[self.motions[:, 0].astype(int)]

    def views(self, log: str) -> Views:
        """Read a drive's images."""
        if log not in self._views:
            recording, table = open_recording(log), PanoramaTable(360, 80)
            assert recording.truth is not None
            images = [recording.image(frame) for frame in range(len(recording.stamps))]
            shown = [
                None if image is None else table.panorama(Image(image), recording.camera).pixels for image in images
            ]
            self._views[log] = Views(shown, recording.truth)
        return self._views[log]

    def described(self, log: str, light: str, settings: Settings) -> list[Any]:
        """Features of every image."""
        stage, context = HsvHistogram(**settings["features"]), Context("features")
        return [
            None if pixels is None else stage.step(context, Panorama(in_light(pixels, LIGHTS[light]))).features
            for pixels in self.views(log).pixels
        ]

    def map(self, settings: Settings) -> tuple[ReferenceGraph, LengthScale]:
        """The map of the tour, and how far its views resemble each other."""
        key = json.dumps(settings["features"])
        if key not in self._maps:
            learned: ReferenceGraph | None = None
            stage, context, state = LearnReferenceGraph(), Context("mapping"), LearnReferenceGraphState()
            truth = self.views(self.on.tour).truth
            for features, pose in zip(self.described(self.on.tour, "as is", settings), truth, strict=True):
                if features is not None and np.isfinite(pose).all():
                    learned = stage.step(context, features, None, Pose(*pose.tolist()), learned, state).map
            assert learned is not None
            self._maps[key] = (
                learned,
                LengthScale(length_scale(learned.poses, learned.features[:], learned.kind) or 0.5),
            )
        return self._maps[key]

    def similarities(self, light: str, settings: Settings) -> Any:
        """Of every image that the filter sees: (images, references, headings)."""
        names = [f"{name}={value}" for node in ("features", "match") for name, value in settings[node].items()]
        file = self._kept / f"{' '.join([light, *names])}.npy"
        if not file.exists():
            stage, context, (learned, _) = SelectiveMatch(**settings["match"]), Context("match"), self.map(settings)
            seen = self.described(self.on.drive, light, settings)
            frames = [int(frame) for frame in self.motions[:, 0]]
            np.save(file, [stage.step(context, seen[frame], learned).similarities.values for frame in frames])
        return np.load(file, mmap_mode="r")

    def _motions(self) -> Array:
        """Frame, motion since the last (m, m, rad; NaN: none) of every image that the filter sees: (N, 4)."""
        file = self._kept / "motions.npy"
        if not file.exists():
            run = omninav.run(
                *words("omniview_mcl", self.on), "seed=0", f"runs={self._kept}", "plots=none", progress=False
            )
            with (run.folder / "frames.csv").open(encoding="utf-8") as rows:
                names = ("frame", "motion_x", "motion_y", "motion_turn")
                np.save(file, [[float(row[name] or "nan") for name in names] for row in csv.DictReader(rows)])
        found: Array = np.load(file)
        return found


def estimates(drives: Drives, light: str, settings: Settings, seed: int, images: npt.NDArray[np.int64]) -> Array:
    """Poses (N, 3) as the filter finds them from a start anywhere, of these images alone."""
    learned, unit = drives.map(settings)
    similarities = drives.similarities(light, settings)
    stage: dict[str, Any] = {node: NODES[node](**settings[node]) for node in NODES}
    context = {node: Context(node, np.random.default_rng([seed, number])) for number, node in enumerate(NODES)}
    stage["sensor"].setup(context["sensor"])
    context["prior"].tick = Tick(index=0, stamp=0, first_of_log=True)
    belief = stage["prior"].step(context["prior"], learned, None, unit).belief
    found = []
    for image in images:
        row, values = drives.motions[image], similarities[image]
        moved = Motion(*row[1:].tolist()) if np.isfinite(row).all() else None
        belief = stage["motion"].step(context["motion"], belief, moved).belief
        seen = Similarities(np.asarray(values), None, None, 0.5, None)
        weighed = stage["sensor"].step(context["sensor"], seen, belief, learned, moved, unit)
        proposed = stage["proposals"].step(context["proposals"], weighed.field, learned, unit).proposals
        belief = stage["fusion"].step(context["fusion"], belief, weighed.likelihood, proposed).belief
        pose = belief.estimate().pose
        found.append((pose.x, pose.y, pose.heading))
    return np.array(found)


def figures(drives: Drives, light: str, settings: Settings, seeds: int) -> dict[str, float]:
    """Medians over seeds of median, 90 % (m) and share lost, once converged."""
    each, images = [], np.arange(len(drives.motions))
    truth = drives.truth()
    known = np.isfinite(truth).all(axis=1)
    for seed in range(seeds):
        poses, true = estimates(drives, light, settings, seed, images)[known], truth[known]
        start = first_settled(position_errors(poses, true), heading_errors_deg(poses, true)) or 0
        errors = pose_errors(poses[start:], true[start:], 2.5)
        spread = errors["position_error_m"]
        each.append({"error": spread["median"], "p90": spread["p90"], "lost": errors["loss_rate"]})
    return {name: statistics.median(one[name] for one in each) for name in each[0]}


def images_until_found(drives: Drives, settings: Settings, seeds: int) -> str:
    """Median over seeds: images until a robot that is carried on, over the drive's second and third quarter, is right.

    Right is within a metre in five images one after the other.
    """
    number = len(drives.motions)
    images = np.concatenate([np.arange(number // 4), np.arange(3 * number // 4, number)])
    found: list[float] = []
    for seed in range(seeds):
        poses = estimates(drives, "as is", settings, seed, images)
        near = (position_errors(poses, drives.truth()[images]) < 1.0)[number // 4 :]
        right = np.flatnonzero(np.lib.stride_tricks.sliding_window_view(near, 5).all(axis=1))
        found.append(float(right[0]) if len(right) else np.inf)
    middle = statistics.median(found)
    return f"{middle:.0f}" if np.isfinite(middle) else "never"


def table(drives: Drives, lights: list[str], seeds: int) -> list[str]:
    """Markdown: a row per condition and a column per light."""
    lines = [f"| {drives.on.name} | {' | '.join(lights)} | carried off |", f"|---{'|---:' * (len(lights) + 1)}|"]
    for name, settings in conditions().items():
        shown = [cell(figures(drives, light, settings, seeds)) for light in lights]
        shown.append(images_until_found(drives, settings, seeds))
        lines.append(f"| {name} | {' | '.join(shown)} |")
        print(lines[-1], flush=True)
    return [*lines, ""]


def main() -> None:
    """Measure, and write the tables where a page is named."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--level", type=Path, help="folder of a game engine's level")
    parser.add_argument("--write", type=Path, help="page whose tables are replaced")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--lights", nargs="+", default=list(LIGHTS), choices=list(LIGHTS))
    parser.add_argument("--runs", type=Path, default=Path("runs/ladder"), help="where similarities are kept")
    given = parser.parse_args()
    sets = [*data_sets(given.data), *([game_level(given.level)] if given.level else [])]
    lines = [line for on in sets for line in table(Drives(on, given.runs), given.lights, given.seeds)]
    shown = "\n".join([BEGIN, *lines, f"Measured on {date.today()}, {given.seeds} seeds.", END])
    if given.write is not None:
        given.write.write_text(replaced(given.write.read_text(), shown))


if __name__ == "__main__":
    main()
