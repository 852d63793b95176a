"""The motion of a camera that sits beside its robot's axis."""

from dataclasses import replace

import numpy as np

from omninav.stages.camera.model import Camera
from omninav.stages.geometry.plane.mount import camera_step
from omninav.stages.values.pose import Motion


def camera_motion(motion: Motion | None, camera: Camera | None) -> Motion | None:
    """The motion increment of a camera whose robot moved, in the camera's place with the robot's heading."""
    if motion is None or camera is None or not camera.arm.any():
        return motion
    x, y, turn = camera_step(np.array([motion.x, motion.y, motion.turn]), camera.arm).tolist()
    return replace(motion, x=x, y=y, turn=turn)
