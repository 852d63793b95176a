"""Local features without those of the robot's own body."""

import math
from dataclasses import field, replace

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.own_body import OwnBody
from omninav.stages.values.pose import AssumedMotion, Motion

CELLS = 80
"""Cells along the longer side of an image."""
SAME_CELLS = 0.25
"""Distance of two features of one place in the image at most, in cells: 2 pixels of 640."""
MIN_TURN = math.radians(10.0)
"""Turn of the robot after which nothing but its body is seen where it was (rad)."""
MIN_MATCHES, MIN_AGREEMENT = 15, 0.8
"""Matches elsewhere in the image that tell a turn, and the mean cosine of their turns to their mean."""
MIN_MEASURED = math.radians(5.0)
"""Turn that odometry must have measured as well (rad): things near that pass by on one side look like a turn."""
SECTORS, MIN_SECTORS, SAME_TURN = 12, 7, math.radians(10.0)
"""Without odometry: sectors around the robot, those of them that must hold such a match, and by how much its turn
differs from the mean (rad). Things on one side are in half of the sectors at most."""
MAX_LOOKED = 20.0
"""Features of a cell that count: a body that is put on or off later is told then."""
RATIO = 0.8
"""Largest ratio of the distances to the nearest and the second nearest descriptor of a match."""
MIN_RETURNS, MIN_SHARE = 3, 0.2
"""Times that features of a body have to be found again in one place after a turn, and their share of all there."""
MIN_CELLS = 48
"""Fewest cells of a body: by chance 20 were found at once in one of twelve drives without one, 5 in another."""


class OwnBodyState(State):
    """An earlier image, and how often a cell's features were found again in their place, of how many: (R, C) each.

    `turned`: what odometry has measured since (rad), NaN where it did not.
    """

    features: LocalFeatures | None = None
    turned: float = 0.0
    looks: Floats = field(default_factory=lambda: np.empty((0, 128), np.float32))
    returns: Array = field(default_factory=lambda: np.zeros((1, 1)))
    looked: Array = field(default_factory=lambda: np.zeros((1, 1)))
    body: OwnBody = field(default_factory=OwnBody)


class WithoutBody(Stage):
    """Leaves out features of the robot's own body: what looks the same in the same place of images, however it turns.

    Not in the papers. An image is compared with an earlier one once the features that moved in it show a turn, which
    odometry must have measured as well; without odometry they must lie on more than one side of the robot.
    """

    class Out(Outputs):
        """The features of the world, and where the body was found so far."""

        features: LocalFeatures
        body: OwnBody

    def step(
        self,
        ctx: Context,
        features: LocalFeatures,
        camera: Camera,
        state: OwnBodyState,
        motion: Motion | None = None,
    ) -> Out:
        looks = root_descriptors(features.descriptors)
        if ctx.tick.first_of_log or (camera.width, camera.height_px) != state.body.size:
            _begin(state, camera, ctx.tick.log)
        measured = motion is not None and not isinstance(motion, AssumedMotion)
        state.turned += motion.turn if motion is not None and measured else math.nan
        if state.features is None or looks.shape[1] != state.looks.shape[1]:
            _keep(state, features, looks)
        elif self._compared(state, state.features, features, looks, camera.wraps):
            share = np.count_nonzero(state.body.cells) / state.body.cells.size
            ctx.fact("own_body", f"covers {share:.0%} of the image, whose features are left out")
        return self.Out(features=state.body.without(features), body=state.body)

    def _compared(
        self, state: OwnBodyState, before: LocalFeatures, features: LocalFeatures, looks: Floats, circle: bool
    ) -> bool:
        """Compares an image with the earlier one. Returns whether this changes where the body is."""
        pairs = mutual_nearest_units(state.looks, looks, RATIO)
        was, now = before.points[pairs.first], features.points[pairs.second]
        stays = np.hypot(*(now - was).T) < SAME_CELLS * state.body.side
        first, second = before.bearings[pairs.first[~stays]], features.bearings[pairs.second[~stays]]
        if len(first) < MIN_MATCHES:
            _keep(state, features, looks)
            return False
        azimuths = np.arctan2(first[:, 1], first[:, 0])
        turns = np.exp(1j * (np.arctan2(second[:, 1], second[:, 0]) - azimuths))
        turn = turns.mean()
        if abs(turn) < MIN_AGREEMENT or abs(np.angle(turn)) < MIN_TURN:
            return False
        alike = np.abs(np.angle(turns / turn)) < SAME_TURN
        sectors = np.unique((azimuths[alike] // (math.tau / SECTORS)).astype(np.int64))
        if abs(state.turned) < MIN_MEASURED or (math.isnan(state.turned) and len(sectors) < MIN_SECTORS):
            return False
        _keep(state, features, looks)
        for counts, pixels in ((state.returns, now[stays]), (state.looked, features.points)):
            np.add.at(counts, state.body.rows_and_columns(pixels), 1.0)
        kept = MAX_LOOKED / np.maximum(state.looked, MAX_LOOKED)
        state.returns, state.looked = kept * state.returns, kept * state.looked
        returns, looked = _with_neighbours(state.returns, circle), _with_neighbours(state.looked, circle)
        cells = (returns >= MIN_RETURNS) & (returns >= MIN_SHARE * looked)
        cells &= np.count_nonzero(cells) >= MIN_CELLS
        if (cells == state.body.cells).all():
            return False
        state.body = replace(state.body, cells=cells)
        return True


def _keep(state: OwnBodyState, features: LocalFeatures, looks: Floats) -> None:
    """Compares later images with this one."""
    state.features, state.looks, state.turned = features, looks, 0.0


def _begin(state: OwnBodyState, camera: Camera, log: int) -> None:
    """Nothing is known of the body in another camera's images, or another log's."""
    side = max(camera.width, camera.height_px) / CELLS
    shape = math.ceil(camera.height_px / side), math.ceil(camera.width / side)
    state.features, state.turned = None, 0.0
    state.body = OwnBody(np.zeros(shape, np.bool_), side, (camera.width, camera.height_px), log)
    state.returns, state.looked = np.zeros(shape), np.zeros(shape)


def _with_neighbours(counts: Array, circle: bool) -> Array:
    """Sums over each cell and the eight around it; on a `circle` the first column borders on the last."""
    padded = np.pad(np.pad(counts, ((0, 0), (1, 1)), mode="wrap" if circle else "constant"), ((1, 1), (0, 0)))
    rows, columns = counts.shape
    return sum((padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)), np.zeros_like(counts))
