"""Views of a simulated robot's camera from the same place on another day."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Pose

from .config import DayNumber, WorldConfig
from .robot_camera import RobotCamera
from .world import World


class OtherDay(Stage):
    """Renders the image at the robot's true pose on another day, in that day's light and without people.

    For claims that nothing changes with the light: no two drives have images from the same places.
    Noise is drawn for each image.
    """

    world: WorldConfig = WorldConfig()
    """The simulated world."""
    day: DayNumber = 1
    """The other day."""

    class Out(Outputs):
        image: Image

    def setup(self, ctx: Context) -> None:
        self._scene, self._camera = World(self.world, self.day).scene, RobotCamera(self.world, "other day", self.day)

    def step(self, ctx: Context, truth: Pose) -> Out:
        pose = np.array([[truth.x, truth.y, truth.heading]])
        return self.Out(image=Image(self._camera.image(self._scene, pose, 0.0, key=int(ctx.rng.integers(2**62)))))
