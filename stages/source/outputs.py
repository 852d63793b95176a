"""Outputs of a source of drives at every tick, whether they are recorded, happen now or are pushed."""

import math

from omninav.pipeline import Outputs, Tick
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.commands import GoalPoint, Reinitialise
from omninav.stages.values.image import Image
from omninav.stages.values.pose import BridgedMotion, Motion, Pose
from omninav.stages.values.scan import Scan


class DriveOutputs(Outputs):
    """An image, how it is to be read, and what else is known at its time."""

    tick: Tick
    image: Image
    camera: Camera
    odometry: Pose | None = None
    motion: Motion | None = None
    truth: Pose | None = None
    scan: Scan | None = None
    restart: Reinitialise | None = None
    goal: GoalPoint | None = None


def motion_of(increment: Array, unmeasured_s: float = 0.0) -> Motion:
    """An increment (3,) as a value; a bridged one where some of it was not measured."""
    x, y, turn = increment.tolist()
    return BridgedMotion(x, y, turn, unmeasured_s) if unmeasured_s else Motion(x, y, turn)


def pose_of(row: Array | None, of: type[Pose] = Pose) -> Pose | None:
    """A pose (3,) as a value; None where it is not known."""
    if row is None:
        return None
    x, y, heading = row.tolist()
    return of(x, y, heading) if math.isfinite(x + y + heading) else None
