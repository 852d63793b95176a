"""A small finished run, made by hand: an eight driven once, a filter that finds itself, odometry that drifts."""

from dataclasses import dataclass

import numpy as np

from omninav.pipeline import Tick
from omninav.stages.geometry.se2 import between
from omninav.stages.values.belief import Particles, PoseEstimate
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion, Pose


@dataclass
class SmallRun:
    ticks: list[Tick]
    beliefs: list[Particles | None]
    estimates: list[PoseEstimate | None]
    truth: list[Pose | None]
    motion: list[Motion | None]
    map: ReferenceGraph

    @property
    def drive(self):
        return self.ticks, self.estimates, self.truth, self.motion


def eight(frames: int) -> np.ndarray:
    angle = 2 * np.pi * np.arange(frames) / frames
    heading = np.arctan2(8 * np.cos(2 * angle), -8 * np.sin(angle))
    return np.stack([8 * np.cos(angle), 4 * np.sin(2 * angle), heading], axis=1)


def small_run(frames: int = 60, logs: int = 1, seed: int = 0) -> SmallRun:
    rng = np.random.default_rng(seed)
    run = SmallRun([], [], [], [], [], reference_graph(40))
    true = eight(frames)
    for log in range(logs):
        for frame in range(frames):
            spread = 0.1 + 4 * np.exp(-frame / 3)
            poses = true[frame] + rng.normal(0, 1, (80, 3)) * [spread, spread, 0.05]
            belief = Particles(poses, np.full(80, 1 / 80))
            run.ticks.append(Tick(len(run.ticks), 10**18 + len(run.ticks) * 10**8, log, frame, frame == 0))
            run.beliefs.append(belief)
            run.estimates.append(belief.estimate())
            run.truth.append(Pose(*map(float, true[frame])))
            step = between(true[frame - 1], true[frame]) * 1.05
            run.motion.append(Motion(*map(float, step)) if frame else None)
    return run


def reference_graph(references: int) -> ReferenceGraph:
    edges = np.stack([np.arange(max(references - 1, 0)), np.arange(1, max(references, 1))], axis=1)
    features = np.zeros((references, 10, 20), dtype=np.float32)
    return ReferenceGraph(eight(references), features, "histograms", edges, "truth")
