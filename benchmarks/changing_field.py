"""A robot that drives on and on in a field whose look keeps changing: made-up views, without any pictures."""

import math
from dataclasses import field
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Source, State, Tick
from omninav.stages.geometry.appearance.spectra import packed
from omninav.stages.geometry.plane.se2 import between, compose, wrap
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.views import Coefficients, Spectrum, WholeView

Array = npt.NDArray[np.float64]
Kind = Literal["spectrum", "coefficients"]
SEGMENTS, CHANNELS, FREQUENCIES, COEFFICIENTS = 36, 24, 8, 128
KEPT = """
    source novelty_threshold match sensor prior motion fusion particle_clustering map_update mapping fixed_lag_smoother
    initial_map estimate
"""
"""Nodes of a variant's graph from the views on."""
MADE_UP = {
    "features.view": "source.view",
    "visual_turn.motion": "source.motion",
    "straightened.updates": "map_update.updates",
}
"""Inputs from nodes that see images or look back over whole drives, and the inputs that replace them."""
CELL, PATCH, REACH = 1.0, 2.0, 2.0
"""Metres: of the field's texture, of what changes at once, and how far from the robot it sees the texture."""


class Drive(State):
    """Where the robot is, where it goes, the texture, and how far it has come."""

    step: int = 0
    pose: Array = field(default_factory=lambda: np.zeros(3))
    goal: Array = field(default_factory=lambda: np.zeros(2))
    texture: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))


class ChangingField(Source):
    """Drives `steps` steps of `stride` metres between random goals in `width` x `depth` metres, with noisy odometry.

    What lies around the robot at 2 m is a random texture, so that views change with the place as smoothly as it does. A
    view is its spectrum, or its projection onto random directions, for each heading one. Every `every` steps a patch of
    2 x 2 m gets a new texture; 0: none ever.
    """

    steps: Annotated[int, Bounds(ge=1)] = 100_000
    every: Annotated[int, Bounds(ge=0)] = 500
    stride: Annotated[float, Bounds(gt=0)] = 0.15
    width: Annotated[float, Bounds(gt=0)] = 4.0
    depth: Annotated[float, Bounds(gt=0)] = 3.5
    kind: Kind = "spectrum"

    class Out(Outputs):
        tick: Tick
        view: WholeView
        motion: Motion | None = None
        truth: Pose | None = None

    def step(self, ctx: Context, drive: Drive) -> Out | None:
        """One step further."""
        if drive.step >= self.steps:
            return None
        rng = ctx.rng
        if not drive.step:
            drive.texture = texture_of(self.width, self.depth)
            drive.pose = np.array([self.width / 2, self.depth / 2, 0.0])
            drive.goal = drive.pose[:2].copy()
        elif self.every and drive.step % self.every == 0:
            size = int(PATCH / CELL)
            row, column = (int(rng.integers(0, side - size + 1)) for side in drive.texture.shape[1:])
            drive.texture[:, row : row + size, column : column + size] = rng.standard_normal((CHANNELS, size, size))
        motion = self._drive(drive, rng) if drive.step else None
        x, y, heading = drive.pose.tolist()
        tick = Tick(drive.step, drive.step * 10**8, 0, drive.step, drive.step == 0)
        drive.step += 1
        return self.Out(
            tick=tick, view=view_at(drive.pose, drive.texture, self.kind), motion=motion, truth=Pose(x, y, heading)
        )

    def length(self) -> int | None:
        """Steps in all."""
        return self.steps

    def _drive(self, drive: Drive, rng: np.random.Generator) -> Motion:
        ahead = drive.goal - drive.pose[:2]
        if math.hypot(*ahead) < 0.5:
            drive.goal = rng.uniform([0.5, 0.5], [self.width - 0.5, self.depth - 0.5])
        turn = float(np.clip(wrap(math.atan2(ahead[1], ahead[0]) - drive.pose[2]), -0.5, 0.5))
        after = compose(drive.pose, [self.stride, 0.0, turn])
        moved = between(drive.pose, after)
        drive.pose = after
        way = self.stride * (1.0 + 0.1 * rng.standard_normal())
        return Motion(way, 0.0, float(moved[2]) + 0.02 * float(rng.standard_normal()))


def texture_of(width: float, depth: float) -> Array:
    """The texture that a field begins with: (channels, rows, columns)."""
    rows, columns = (int((side + 2 * REACH) / CELL) + 2 for side in (depth, width))
    return np.random.default_rng(0).standard_normal((CHANNELS, rows, columns))


def view_at(pose: Array, texture: Array, kind: Kind) -> WholeView:
    """What a robot sees at a pose (x, y, heading)."""
    around = -2.0 * math.pi * np.arange(SEGMENTS) / SEGMENTS + pose[2]  # clockwise, as columns run
    x = (pose[0] + REACH * (1.0 + np.cos(around))) / CELL
    y = (pose[1] + REACH * (1.0 + np.sin(around))) / CELL
    left, low = x.astype(np.int64), y.astype(np.int64)
    a, b = x - left, y - low
    lower = (1 - a) * texture[:, low, left] + a * texture[:, low, left + 1]
    upper = (1 - a) * texture[:, low + 1, left] + a * texture[:, low + 1, left + 1]
    signal = (1 - b) * lower + b * upper
    if kind == "spectrum":
        spectrum = np.fft.rfft(signal, axis=1)[:, :FREQUENCIES] / math.sqrt(SEGMENTS)
        return Spectrum(packed(spectrum), CHANNELS, SEGMENTS)
    turned = np.stack([np.roll(signal, heading, axis=1).ravel() for heading in range(SEGMENTS)])
    rows = (turned @ _directions()).astype(np.float32)
    return Coefficients(rows[0], rows)


@cache
def _directions() -> Array:
    return np.random.default_rng(1).standard_normal((CHANNELS * SEGMENTS, COEFFICIENTS)) / math.sqrt(COEFFICIENTS)


def graph_on_field(variant: str, source: dict[str, Any], limit: float | None = None, *words: str) -> Any:
    """A variant's graph from the views on, fed by a `ChangingField` of these parameters, up to its belief and map.

    `limit`: a given limit between views, instead of a measured one. `words`: what else would be typed.
    """
    from omninav.pipeline.cli.composition import complete, composed
    from omninav.pipeline.run.prepared_run import prepare_run

    with composed([f"variant={variant}", *words]) as composition:
        config = complete(composition)
    nodes, wires = config["nodes"], config["wires"]
    nodes["source"] = {"_target_": "benchmarks.changing_field.ChangingField", **source}
    if limit is not None:
        target = "omninav.stages.mapping.fixed_threshold.FixedThreshold"
        nodes["novelty_threshold"], wires["novelty_threshold"] = {"_target_": target, "distance": limit}, {}
    kept = {name for name in KEPT.split() if nodes.get(name)}
    config["nodes"] = {name: nodes[name] for name in nodes if name in kept}
    config["wires"] = {
        name: {port: MADE_UP.get(wire, wire) if isinstance(wire, str) else wire for port, wire in ports.items()}
        for name, ports in wires.items()
        if name in kept
    }
    config["saves"] = {}  # the map that is saved is made after the last tick, by nodes that are not kept
    for artifact in config["artifacts"].values():
        artifact["must_match"] = []  # the views come from the field, not from the nodes that a map is compared by
    return prepare_run(config).graph
