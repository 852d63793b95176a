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

CELLS = 80
"""Cells along the longer side of an image."""
SAME_CELLS = 0.25
"""Distance of two features of one place in the image at most, in cells: 2 pixels of 640."""
MIN_TURN = math.radians(10.0)
"""Turn of the robot after which nothing but its body is seen where it was (rad)."""
MIN_MATCHES, MIN_AGREEMENT = 15, 0.8
"""Matches elsewhere in the image that tell a turn, and the mean cosine of their turns to their mean."""
RATIO = 0.8
"""Largest ratio of the distances to the nearest and the second nearest descriptor of a match."""
MIN_RETURNS, MIN_SHARE = 5, 0.2
"""Times that features of a body have to be found again in one place after a turn, and their share of all there."""
MIN_CELLS = 24
"""Fewest cells of a body: by chance 7 were found at once in one of twelve drives without one, in the others none."""


class OwnBodyState(State):
    """An earlier image, and how often a cell's features were found again in their place, of how many: (R, C) each."""

    size: tuple[int, int] = (0, 0)
    features: LocalFeatures | None = None
    looks: Floats = field(default_factory=lambda: np.empty((0, 128), np.float32))
    returns: Array = field(default_factory=lambda: np.zeros((1, 1)))
    looked: Array = field(default_factory=lambda: np.zeros((1, 1)))
    body: OwnBody = field(default_factory=OwnBody)


class WithoutBody(Stage):
    """Leaves out features of the robot's own body: what looks the same in the same place of images, however it turns.

    Not in the papers. An image is compared with an earlier one once most features that are elsewhere in it show a turn.
    """

    class Out(Outputs):
        """The features of the world, and where the body was found so far."""

        features: LocalFeatures
        body: OwnBody

    def step(self, ctx: Context, features: LocalFeatures, camera: Camera, state: OwnBodyState) -> Out:
        looks = root_descriptors(features.descriptors)
        if (camera.width, camera.height_px) != state.size:
            _begin(state, camera)
        if state.features is None or looks.shape[1] != state.looks.shape[1]:
            state.features, state.looks = features, looks
        elif self._compared(state, state.features, features, looks):
            share = np.count_nonzero(state.body.cells) / state.body.cells.size
            ctx.fact("own_body", f"covers {share:.0%} of the image, whose features are left out")
        return self.Out(features=state.body.without(features), body=state.body)

    def _compared(self, state: OwnBodyState, before: LocalFeatures, features: LocalFeatures, looks: Floats) -> bool:
        """Compares an image with the earlier one. Returns whether this changes where the body is."""
        pairs = mutual_nearest_units(state.looks, looks, RATIO)
        was, now = before.points[pairs.first], features.points[pairs.second]
        stays = np.hypot(*(now - was).T) < SAME_CELLS * state.body.side
        first, second = before.bearings[pairs.first[~stays]], features.bearings[pairs.second[~stays]]
        if len(first) < MIN_MATCHES:
            state.features, state.looks = features, looks
            return False
        turn = np.exp(1j * (np.arctan2(second[:, 1], second[:, 0]) - np.arctan2(first[:, 1], first[:, 0]))).mean()
        if abs(turn) < MIN_AGREEMENT or abs(np.angle(turn)) < MIN_TURN:
            return False
        state.features, state.looks = features, looks
        for counts, pixels in ((state.returns, now[stays]), (state.looked, features.points)):
            np.add.at(counts, state.body.rows_and_columns(pixels), 1.0)
        returns, looked = _with_neighbours(state.returns), _with_neighbours(state.looked)
        cells = (returns >= MIN_RETURNS) & (returns >= MIN_SHARE * looked)
        cells &= np.count_nonzero(cells) >= MIN_CELLS
        if (cells == state.body.cells).all():
            return False
        state.body = replace(state.body, cells=cells)
        return True


def _begin(state: OwnBodyState, camera: Camera) -> None:
    """Nothing is known of the body in another camera's images."""
    side = max(camera.width, camera.height_px) / CELLS
    shape = math.ceil(camera.height_px / side), math.ceil(camera.width / side)
    state.size, state.features = (camera.width, camera.height_px), None
    state.body = OwnBody(np.zeros(shape, np.bool_), side)
    state.returns, state.looked = np.zeros(shape), np.zeros(shape)


def _with_neighbours(counts: Array) -> Array:
    """Sums over each cell and the eight around it."""
    padded = np.pad(counts, 1)
    rows, columns = counts.shape
    return sum((padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)), np.zeros_like(counts))
