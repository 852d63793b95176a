"""The homing vector of a local map."""

import math

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.plane.mount import robot_step
from omninav.stages.geometry.two_views.epipolar import yaw_of
from omninav.stages.values.homing import HomingVector, LocalMap


class HomingVectorFromMap(Stage):
    """Computes direction and turn from the robot to the target view, from the poses of both in the local map.

    Goedemé et al. 2007, section 7.2.4. Of a lost target it is what was known last, moved on by odometry.
    """

    class Out(Outputs):
        """Absent where there is no target."""

        vector: HomingVector | None = None

    def step(self, ctx: Context, map: LocalMap | None = None, camera: Camera | None = None) -> Out:
        """One homing vector, of the robot under the `camera`."""
        if map is None:
            return self.Out()
        if not len(map):
            return self.Out(
                vector=HomingVector(map.target, 0.0, 0.0, 1.0, 1.0, 1.0, None, map.inliers, map.state, map.why)
            )
        (x, y, _), turn = map.to_target(), yaw_of(map.rotation.T @ map.goal_rotation)
        if camera is not None and map.metres > 0.0:
            x, y, _ = robot_step(np.array([x, y, turn]), camera.arm / [map.metres, map.metres, 1.0]).tolist()
        distance, depth = math.hypot(x, y), map.depth()
        vector = HomingVector(
            number=map.target,
            direction=math.atan2(y, x),
            turn=turn,
            distance=distance,
            ratio=distance * map.unit,
            depth_ratio=distance / depth if depth > 0.0 else 1.0,
            metres=distance * map.metres if map.metres > 0.0 else None,
            inliers=map.inliers,
            state=map.state,
            why=map.why,
        )
        return self.Out(vector=vector)
