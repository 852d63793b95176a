"""Local features without those of the robot's own body."""

import math
from dataclasses import field, replace

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.arrays import Array, Floats, Ints
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
MIN_RETURNS, MIN_SHARE = 3, 0.2
"""Times that features have to be found again in one place after a turn, and their share of all there, of a body."""


class OwnBodyState(State):
    """An earlier image, and how often a cell's features were found again in their place, of how many: (R, C) each."""

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
        if state.body.side == math.inf:
            side = max(camera.width, camera.height_px) / CELLS
            shape = math.ceil(camera.height_px / side), math.ceil(camera.width / side)
            state.returns, state.looked = np.zeros(shape), np.zeros(shape)
            state.body = OwnBody(np.zeros(shape, np.bool_), side)
        if state.features is None:
            state.features, state.looks = features, looks
        else:
            self._compare(state, features, looks)
        return self.Out(features=state.body.without(features), body=state.body)

    def _compare(self, state: OwnBodyState, features: LocalFeatures, looks: Floats) -> None:
        before = state.features
        assert before is not None
        pairs = mutual_nearest_units(state.looks, looks, RATIO)
        was, now = before.points[pairs.first], features.points[pairs.second]
        stays = np.hypot(*(now - was).T) < SAME_CELLS * state.body.side
        first, second = before.bearings[pairs.first[~stays]], features.bearings[pairs.second[~stays]]
        turns = np.arctan2(second[:, 1], second[:, 0]) - np.arctan2(first[:, 1], first[:, 0])
        mean = np.exp(1j * turns).mean() if len(turns) >= MIN_MATCHES else 0.0
        if abs(mean) >= MIN_AGREEMENT and abs(np.angle(mean)) >= MIN_TURN:
            np.add.at(state.returns, self._rows(state, now[stays]), 1.0)
            np.add.at(state.looked, self._rows(state, features.points), 1.0)
            returns, looked = _with_neighbours(state.returns), _with_neighbours(state.looked)
            cells = (returns >= MIN_RETURNS) & (returns >= MIN_SHARE * looked)
            if (cells != state.body.cells).any():
                state.body = replace(state.body, cells=cells)
        elif len(turns) >= MIN_MATCHES:
            return
        state.features, state.looks = features, looks

    @staticmethod
    def _rows(state: OwnBodyState, pixels: Array) -> tuple[Ints, Ints]:
        column, row = state.body.cells_of(pixels)
        return row, column


def _with_neighbours(counts: Array) -> Array:
    """Sums over each cell and the eight around it."""
    padded = np.pad(counts, 1)
    rows, columns = counts.shape
    return sum((padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)), np.zeros_like(counts))
