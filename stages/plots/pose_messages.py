"""Poses, transforms and beliefs as ROS 2 messages: nested mappings of fields, or message objects where there are many.

Poses are x, y (m), heading (rad) on the floor; headings become quaternions about z.
"""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline.mcap.message_rows import MessageRows, row_bytes
from omninav.pipeline.mcap.message_types import encode_message, standard_types
from omninav.stages.geometry.arrays import Array

Fields = dict[str, Any]
MAP, ODOM, BASE = "map", "odom", "base_link"
"""Frames: the map's, the odometry's, the robot's."""
_HEAD = 4
"""Bytes before a message's body."""
UNKNOWN_VARIANCE = 1e6
"""Variance of a published pose of which nothing is known, m² and rad²."""


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


def path_bytes(stamps: npt.ArrayLike, poses: Array, now: int) -> bytes:
    """The CDR bytes of a nav_msgs/Path in the map frame: poses (N, 3) at stamps (N,); `now` is its own stamp (ns)."""
    empty = encode_message("nav_msgs/msg/Path", {"header": header(now)})
    if not len(poses):
        return empty
    rows = _stamped_poses().rows(len(poses))
    set_stamps(rows["header"], stamps)
    set_poses(rows["pose"], poses)
    first, *others = (pose[_HEAD:] for pose in row_bytes(rows))
    # Doubles are at multiples of 8: the first pose, 20 bytes behind the head, is the only one with a gap before them.
    gap = len(first) - 7 * 8
    return b"".join((empty[:-4], len(poses).to_bytes(4, "little"), first[:gap], bytes(4), first[gap:], *others))


@cache
def _stamped_poses() -> MessageRows:
    return MessageRows("geometry_msgs/msg/PoseStamped", {"header": header(0)})


def set_stamps(headers: npt.NDArray[np.void], stamps: npt.ArrayLike) -> None:
    """Assign stamps (ns) to the headers of `MessageRows.rows`."""
    headers["stamp"]["sec"], headers["stamp"]["nanosec"] = np.divmod(np.asarray(stamps, np.int64), 10**9)


def set_poses(rows: npt.NDArray[np.void], poses: Array) -> None:
    """Assign poses (..., 3) to the geometry_msgs/Pose of `MessageRows.rows`."""
    rows["position"]["x"], rows["position"]["y"] = poses[..., 0], poses[..., 1]
    set_heading(rows["orientation"], poses[..., 2])


def set_heading(rows: npt.NDArray[np.void], heading: Array) -> None:
    """Assign headings to the geometry_msgs/Quaternion of `MessageRows.rows`."""
    rows["z"], rows["w"] = np.sin(heading / 2), np.cos(heading / 2)


def covariance_6x6(plane: Array) -> Array:
    """ROS' row-major 6 x 6 covariance (x, y, z, roll, pitch, yaw) of (..., 3, 3) over (x, y, heading): (..., 36).

    One of zeros, of a method that states none, becomes `UNKNOWN_VARIANCE`: filters take zeros for certainty.
    """
    whole = np.zeros((*plane.shape[:-2], 6, 6))
    axes = np.array([0, 1, 5])
    stated = np.any(plane, axis=(-2, -1), keepdims=True)
    whole[..., axes[:, None], axes] = np.where(stated, plane, UNKNOWN_VARIANCE * np.eye(3))
    return whole.reshape(*plane.shape[:-2], 36)


def ros_point(x: float, y: float) -> Fields:
    """A geometry_msgs/Point or Vector3 on the floor."""
    return {"x": float(x), "y": float(y), "z": 0.0}


def quaternion(heading: float) -> Fields:
    """A geometry_msgs/Quaternion about z."""
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}
