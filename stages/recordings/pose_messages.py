"""Poses, transforms and beliefs as ROS 2 messages: nested mappings of fields, or message objects where there are many.

Poses are x, y (m), heading (rad) on the floor; headings become quaternions about z.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline.mcap.message_types import standard_types

Array = npt.NDArray[np.float64]
Fields = dict[str, Any]
MAP, ODOM, BASE = "map", "odom", "base_link"
"""Frames: the map's, the odometry's, the robot's."""


def header(stamp: int, frame: str = MAP) -> Fields:
    """A std_msgs/Header; `stamp` in nanoseconds."""
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": frame}


def ros_pose(pose: Array) -> Fields:
    """A geometry_msgs/Pose of (3,) x, y, heading."""
    return {"position": ros_point(pose[0], pose[1]), "orientation": quaternion(pose[2])}


def transform(stamp: int, parent: str, child: str, pose: Array) -> Fields:
    """A geometry_msgs/TransformStamped: the pose (3,) of frame `child` in frame `parent`."""
    place = {"translation": ros_point(pose[0], pose[1]), "rotation": quaternion(pose[2])}
    return {"header": header(stamp, parent), "child_frame_id": child, "transform": place}


def pose_messages(poses: Array) -> list[Any]:
    """Many poses (N, 3) as message objects: ten times as fast as mappings, and beliefs are most of a log."""
    types = standard_types().types
    pose, point, rotation = (types[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Quaternion"))
    halves = poses[:, 2] / 2
    rows = zip(poses[:, :2].tolist(), np.sin(halves).tolist(), np.cos(halves).tolist(), strict=True)
    return [pose(point(x, y, 0.0), rotation(0.0, 0.0, sin, cos)) for (x, y), sin, cos in rows]


def path_message(stamps: Sequence[int], poses: Array, now: int) -> Fields:
    """A nav_msgs/Path in the map frame: poses (N, 3) at stamps (N,); `now` is its own stamp (ns)."""
    types = standard_types().types
    stamped, head, time = (
        types[name] for name in ("geometry_msgs/msg/PoseStamped", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    heads = [head(time(*divmod(stamp, 10**9)), MAP) for stamp in stamps]
    rows = [stamped(at, pose) for at, pose in zip(heads, pose_messages(poses), strict=True)]
    return {"header": header(now), "poses": rows}


def covariance_6x6(plane: Array) -> Array:
    """ROS' row-major 6 x 6 covariance (x, y, z, roll, pitch, yaw) of a (3, 3) over (x, y, heading): (36,)."""
    whole = np.zeros((6, 6))
    axes = np.array([0, 1, 5])
    whole[np.ix_(axes, axes)] = plane
    return whole.ravel()


def ros_point(x: float, y: float) -> Fields:
    """A geometry_msgs/Point or Vector3 on the floor."""
    return {"x": float(x), "y": float(y), "z": 0.0}


def quaternion(heading: float) -> Fields:
    """A geometry_msgs/Quaternion about z."""
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}
