"""A small finished run, made by hand: an eight driven once, a filter that finds itself, odometry that drifts."""

from dataclasses import dataclass

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.metrics.collect_drive import CollectDrive
from omninav.stages.values.belief import GaussianMixture, Particles, PoseEstimate
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import Drive
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.evidence import ImageEvidence
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import BestMatch
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures


@dataclass
class SmallRun:
    ticks: list[Tick]
    beliefs: list[Particles | None]
    estimates: list[PoseEstimate | None]
    truth: list[Pose | None]
    motion: list[Motion | None]
    map: ReferenceGraph

    @property
    def drive(self) -> Drive:
        return collected(self.ticks, self.truth, self.motion, self.estimates)

    @property
    def blind(self) -> Drive:
        """The same drive without ground truth."""
        return collected(self.ticks, [None] * len(self.ticks), self.motion, self.estimates)


def collected(
    ticks: list[Tick],
    truth: list[Pose | None],
    motion: list[Motion | None] | None = None,
    estimates: list[PoseEstimate | None] | None = None,
    tallies: list[EpisodeStatistics | None] | None = None,
    matches: list[BestMatch | None] | None = None,
    confidences: list[PoseConfidence | None] | None = None,
    evidence: list[ImageEvidence | None] | None = None,
) -> Drive:
    """Sequences as a graph would collect them."""
    still = [None] * len(ticks)
    given = estimates, tallies, matches, confidences, evidence
    return CollectDrive().step(Context("drive"), ticks, truth, motion or still, *given).drive


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


def mixture_run(run: SmallRun) -> tuple[ViewMixtures, list[GaussianMixture], list[ViewEvent], list[ViewMixtures]]:
    """A map of views learned on a small run by hand, its beliefs and events, and the map after every tick.

    Each frame brings a view; view 0 is seen from a second place too, which gains what the first one loses, and every
    fifth frame takes the oldest other view away.
    """
    map, beliefs, events, after = ViewMixtures.empty(), [], [], []
    for number, true in enumerate(run.truth):
        mean, covariance = np.array([true.x, true.y, true.heading]), np.diag([0.2, 0.05, 0.01])
        means, covariances = np.stack([mean, mean + np.array([3.0, 0.0, 0.1])]), np.stack([covariance, 4 * covariance])
        beliefs.append(GaussianMixture(means, covariances, np.array([0.9, 0.1])))
        row = map.add_view(np.full(6, number, np.float32), "Coefficients")
        map.add_component(row, mean, covariance, 0.5, 1.0)
        share = 0.5**number
        start = np.array([[8.0, 0.0, 0.0], [-2.0, 1.0, 0.0]])
        map.put_mixtures(np.array([0, 0]), start, covariances, np.array([share, 1 - share]), np.ones(2))
        removed = np.empty(0, np.int64)
        if number % 5 == 4:
            removed = map.ids[1:2].copy()
            map.keep_views(map.ids != removed[0])
        map.step()
        inserted, changed = np.array([number]), np.array([0])
        heaviest = int(share < 0.5)
        why = "forgotten" if len(removed) else ""
        weight, place = np.array([max(share, 1 - share)]), start[heaviest][None, :2]
        counts = len(map), len(map.weights)
        events.append(ViewEvent(*counts, inserted, inserted, removed, why, changed, weight, place, np.array([2])))
        fields = ("views", "kind", "ids", "born", "owner", "means", "covariances", "weights", "counts")
        after.append(ViewMixtures(*(getattr(map, name) for name in fields), map.steps, map.next_id, map.pose_source))
    return map, beliefs, events, after
