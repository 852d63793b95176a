"""Depths of image features in a simulated world."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.mount import camera_poses
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.values.depths import Depths
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose

from .cameras import camera_of
from .config import DayNumber, WorldConfig
from .first_hits import first_hits
from .world import World


class FeatureDepths(Stage):
    """Measures how far the surface at each feature is from the camera, along its bearing; people are left out."""

    log: str | tuple[str, ...] | None = None
    """A recorded log: then nothing is known of the place and the output is absent."""
    world: WorldConfig = WorldConfig()
    """The simulated world."""
    day: DayNumber = 0
    """Day of the simulated world."""

    class Out(Outputs):
        """`depths`: absent with a recorded log."""

        depths: Depths | None = None

    def setup(self, ctx: Context) -> None:
        self._world = World(self.world, self.day) if self.log is None else None
        self._arm = np.zeros(3) if self.log is not None else camera_of(self.world).arm

    def step(
        self,
        ctx: Context,
        truth: Pose,
        features: LocalFeatures | None = None,
        vertical_segments: VerticalSegments | None = None,
    ) -> Out:
        if self._world is None:
            return self.Out()
        patches = np.zeros((0, 3)) if features is None else features.bearings
        ends = np.zeros((0, 2, 3)) if vertical_segments is None else vertical_segments.bearings()
        rays = np.concatenate([patches, ends.reshape(-1, 3)])
        x, y, _ = camera_poses(np.array([truth.x, truth.y, truth.heading]), self._arm)
        eye = (x, y, self.world.eye_height)
        metres = first_hits(self._world.boxes, self.world.height, eye, rays @ turn_about_vertical(truth.heading).T)
        return self.Out(depths=Depths(metres[: len(patches)], metres[len(patches) :].reshape(-1, 2)))
