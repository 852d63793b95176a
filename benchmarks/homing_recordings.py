"""How well homing vectors of two recorded views point, by distance: tables of docs/experiments/homing_real_images.md.

    python benchmarks/homing_recordings.py --data FOLDER
    python benchmarks/homing_recordings.py --data FOLDER --development

Pairs are drawn at random, 0.05 to 2 m apart, and each present view is turned by a random angle. On the grid, pairs
whose two image numbers have an even sum are for development, as route 1 is; the rest is measured. Printed: share with a
vector (%), median and 90 % of the error of its direction (degrees), without a vector 180, and CPU milliseconds.
"""

import argparse
import itertools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from omninav import Context
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.model import Camera
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.homing.homing_vector import HomingVectorFromMap
from omninav.stages.homing.local_mapping import LocalMapping, LocalMappingState
from omninav.stages.homing.warping import MinWarping, MinWarpingState
from omninav.stages.match.correspondences import MatchFeatures
from omninav.stages.recordings.opening import open_recording
from omninav.stages.values.homing import HomingTarget, HomingVector
from omninav.stages.values.image import Image, Panorama

ANTWORLD = Equirectangular(720, 150, 360, sense="clockwise", elevation_top=1.0559, elevation_bottom=-0.2531)
LOST = HomingVector(0, 0.0, 0.0, 1.0, 1.0, 1.0, None, 0, "lost")
BINS = (0.05, 0.5, 1.0, 1.5, 2.0)


@dataclass(frozen=True)
class Pair:
    """The present view and the target's, the direction and the turn to the target (rad), and the distance (m)."""

    here: Image | Panorama
    target: Image | Panorama
    camera: Camera
    direction: float
    turn: float
    metres: float


def to_the_right(camera: Camera) -> float:
    """By how much (rad) a robot has turned whose strip moved to the right by a column."""
    step = 2 * math.pi / camera.width
    return step if getattr(camera, "sense", "clockwise") == "clockwise" else -step


def pairs(log: str, camera: Camera | None, parity: int | None, number: int) -> Iterator[Pair]:
    """Pairs of a recording; strips are turned by rolling their columns, other images are as they are."""
    recording = open_recording(log)
    seen_by, truth, rng = camera or recording.camera, recording.truth, np.random.default_rng(0)
    assert truth is not None
    known = np.flatnonzero(np.isfinite(truth).all(axis=1))
    made = 0
    while made < number:
        here, target = (int(n) for n in rng.choice(known, 2))
        metres = math.dist(truth[here, :2], truth[target, :2])
        if not BINS[0] <= metres <= BINS[-1] or (parity is not None and (here + target) % 2 != parity):
            continue
        present, goal = recording.image(here), recording.image(target)
        if present is None or goal is None:
            continue
        turned = 0.0
        if seen_by.wraps:
            columns = int(rng.integers(seen_by.width))
            present, turned = np.roll(present, columns, axis=1), to_the_right(seen_by) * columns
        x, y = truth[target, :2] - truth[here, :2]
        heading = truth[here, 2] + turned
        made += 1
        yield Pair(Image(present), Image(goal), seen_by, math.atan2(y, x) - heading, truth[target, 2] - heading, metres)


class Methods:
    """Each gives the homing vector of a pair, or None."""

    def __init__(self) -> None:
        self._ctx = Context("homing", np.random.default_rng(0))
        self._sift, self._match = RotationReducedSift(contrast=0.02), MatchFeatures(ratio=0.9)
        self._mapping, self._vector = LocalMapping(), HomingVectorFromMap()
        for stage in (self._sift, self._match, self._mapping, self._vector):
            stage.setup(self._ctx)

    def features(self, pair: Pair) -> HomingVector:
        """Two views alone, by SIFT."""
        here, goal = (self._sift.step(self._ctx, each, pair.camera).features for each in (pair.here, pair.target))
        found = self._match.step(self._ctx, here, goal).correspondences
        out = self._mapping.step(self._ctx, LocalMappingState(), here, HomingTarget(0, goal), found)
        vector = self._vector.step(self._ctx, out.map).vector
        assert vector is not None
        return vector

    def warping(self, pair: Pair, given: HomingVector = LOST, compass: float | None = None) -> HomingVector:
        """Columns; with a compass the target's view is turned to the present heading, and 10 degrees are searched."""
        stage = MinWarping(max_turn_deg=180.0 if compass is None else 10.0)
        stage.setup(self._ctx)
        target = pair.target
        if compass is not None:
            columns = round(pair.turn / to_the_right(pair.camera))
            target = Image(np.roll(target.pixels, -columns, axis=1))
        found = stage.step(self._ctx, MinWarpingState(), pair.here, given, target, pair.camera).vector
        assert found is not None
        return found


def measure(name: str, log: str, camera: Camera | None, parity: int | None, number: int, only: str | None) -> None:
    """Print a row per method: the figures of each bin of distance, and of all."""
    methods = Methods()
    rows: dict[str, Callable[[Pair], HomingVector]] = {
        "features": methods.features,
        "warping": methods.warping,
        "both": lambda pair: methods.warping(pair, methods.features(pair)),
    }
    drawn = list(pairs(log, camera, parity, number))
    if drawn[0].camera.wraps:
        rows["warping with a compass"] = lambda pair: methods.warping(pair, compass=pair.turn)
    rows = {method: row for method, row in rows.items() if only in (None, method)}
    metres = np.array([pair.metres for pair in drawn])
    for method, vector_of in rows.items():
        vector_of(drawn[0])  # compiled
        began = time.process_time()
        vectors = [vector_of(pair) for pair in drawn]
        taken = 1e3 * (time.process_time() - began) / len(drawn)
        found = np.array([vector.state != "lost" for vector in vectors])
        errors = [abs(math.remainder(v.direction - p.direction, math.tau)) for v, p in zip(vectors, drawn, strict=True)]
        degrees = np.where(found, np.degrees(errors), 180.0)
        cells = []
        for low, high in [*itertools.pairwise(BINS), (BINS[0], BINS[-1])]:
            some = (metres >= low) & (metres <= high)
            figures = np.quantile(degrees[some], [0.5, 0.9]) if some.any() else (math.nan, math.nan)
            cells.append(f"{100 * found[some].mean():.0f} / {figures[0]:.0f} / {figures[1]:.0f}" if some.any() else "–")
        print(f"| {name} | {method} | {' | '.join(cells)} | {taken:.0f} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--development", action="store_true", help="the pairs that parameters were chosen on")
    parser.add_argument("--pairs", type=int, default=200, help="pairs of each recording")
    parser.add_argument("--method", help="one alone: features, warping, both, warping with a compass")
    given = parser.parse_args()
    many, only = given.pairs, given.method
    ants, sussex = given.data / "antworld-rendered", given.data / "sussex-outdoor-route"
    bins = [f"{low:g} to {high:g} m" for low, high in itertools.pairwise(BINS)]
    print(f"| recording | method | {' | '.join(bins)} | all | ms |\n|---|---|{'---|' * (len(bins) + 2)}")
    parity, route = (0, "ant1_route1") if given.development else (1, "ant1_route2")
    measure("AntWorld, grid", f"antworld:{ants / 'grid_200mm'}", ANTWORLD, parity, many, only)
    measure(f"AntWorld, {route}", f"antworld:{ants / route}", ANTWORLD, None, many, only)
    if not given.development:
        measure("house", str(given.data / "photoreal-house" / "tour.mcap"), None, None, many, only)
        measure("Sussex", f"sussex_training:{sussex}", None, None, many, only)


if __name__ == "__main__":
    main()
