"""Toys of concurrent map building: a robot drives round after round and knows where it is, but for some stretches."""

import numpy as np

from omninav.pipeline import Context, Outputs, Source, Stage, State, Tick
from omninav.stages.geometry.plane.odometry_motion import decompose_motion
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import Coefficients, NoveltyThreshold

ROUND = 25
FREQUENCIES = np.random.default_rng(1).normal(0.0, 1.5, (2, 12))


def place(tick: int) -> np.ndarray:
    angle = 2 * np.pi * tick / ROUND
    return np.array([2 * np.cos(angle), 2 * np.sin(angle), angle + np.pi / 2])


def look(tick: int) -> np.ndarray:
    return np.cos(place(tick)[:2] @ FREQUENCIES + 0.01 * tick).astype(np.float32)


def way(tick: int) -> UncertainMotion:
    return UncertainMotion(decompose_motion(*map(float, between(place(tick - 1), place(tick)))), (0.02, 0.02, 0.02))


class At(State):
    tick: int = 0


class Rounds(Source):
    """Two logs of equal length; views follow from the place, and change a little as time goes by."""

    ticks: int = 90

    class Out(Outputs):
        tick: Tick
        view: Coefficients
        threshold: NoveltyThreshold
        model: UncertainMotion | None = None

    def step(self, ctx: Context, at: At) -> Out | None:
        n = at.tick
        if n == self.ticks:
            return None
        at.tick += 1
        half = self.ticks // 2
        model = way(n)
        first = n % half == 0
        view = Coefficients(look(n), look(n)[None])
        tick = Tick(n, n * 10**9, n // half, n % half, first)
        return self.Out(tick=tick, view=view, threshold=NoveltyThreshold(1.0), model=None if first else model)


class Knows(Stage):
    """A belief at the true place, with a second one as heavy from tick 20 to 34; raises at tick `breaks_at`."""

    breaks_at: int = -1

    class Out(Outputs):
        belief: GaussianMixture

    def step(self, ctx: Context, view: Coefficients) -> Out:
        n = ctx.tick.index
        if n == self.breaks_at:
            raise RuntimeError("the wheel fell off")
        means = np.stack([place(n), place(n) + np.array([5.0, 0.0, 0.0])])[: 2 if 20 <= n < 35 else 1]
        covariances = np.stack([np.diag([0.01, 0.01, 0.004])] * len(means))
        return self.Out(belief=GaussianMixture(means, covariances, np.full(len(means), 1.0 / len(means))))
