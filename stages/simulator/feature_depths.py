"""How far away what features show is, asked of the simulated world."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.values.depths import Depths
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments
from omninav.stages.values.pose import Pose

from .config import WorldConfig
from .demo import DEMO
from .first_hits import first_hits
from .world import World


class FeatureDepths(Stage):
    """Distances from the camera to what its features show, in a simulated world as it stands on `day`.

    A ray is cast along each bearing; people are not there. With a recorded `log` nothing is known of its place.
    """

    log: str | tuple[str, ...] | None = None
    world: WorldConfig = DEMO
    day: Annotated[int, Bounds(ge=0)] = 0

    class Out(Outputs):
        """`depths`: absent where a log is driven through."""

        depths: Depths | None = None

    def setup(self, ctx: Context) -> None:
        """What stands where."""
        self._world = World(self.world, self.day) if self.log is None else None

    def step(
        self,
        ctx: Context,
        truth: Pose,
        features: LocalFeatures | None = None,
        vertical_segments: VerticalSegments | None = None,
    ) -> Out:
        """Cast the rays of one picture."""
        if self._world is None:
            return self.Out()
        patches = np.zeros((0, 3)) if features is None else features.bearings
        ends = np.zeros((0, 2, 3)) if vertical_segments is None else vertical_segments.bearings()
        rays = np.concatenate([patches, ends.reshape(-1, 3)])
        eye = (truth.x, truth.y, self.world.eye_height)
        metres = first_hits(self._world.boxes, self.world.height, eye, rays @ turn_about_vertical(truth.heading).T)
        return self.Out(depths=Depths(metres[: len(patches)], metres[len(patches) :].reshape(-1, 2)))
