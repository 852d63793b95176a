"""The run as a log of ROS 2 messages, for Foxglove, rosbags and whoever else reads MCAP."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.mcap.message_types import standard_types
from omninav.pipeline.mcap.writer import LogWriter
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.command import Command
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.view_mixtures import ViewMixtures

from .thin_belief import heaviest, thin

Shown = Particles | GaussianMixture
Fields = dict[str, Any]
FRAME = "map"


class ResultLog(Stage):
    """Writes `result.mcap`: estimates and beliefs beside the truth.

    | topic | message | holds |
    |---|---|---|
    | `/estimate/pose` | PoseWithCovarianceStamped | the estimate per frame; 6 x 6 covariance, plane entries only |
    | `/estimate/path` | Path | all of a log's estimates, at its end |
    | `/belief` | PoseArray | the belief in few poses per frame; of a mixture, its Gaussians' means |
    | `/belief/gaussians` | MarkerArray | a mixture's Gaussians: the axes of their ellipses, one sigma each way |
    | `/odom` | Odometry | odometry alone, from the log's first frame, in the frame `odom` |
    | `/ground_truth/pose` | PoseStamped | where the log has it |
    | `/map` | MarkerArray | a graph's references and edges, once per log; what mixtures were learned, at the end |
    | `/command` | TwistStamped | what was commanded, in a closed loop |
    | `/tf` | TFMessage | `map` to `odom`, once per log: odometry laid where `odometry alone` starts |

    Stamps are the images' header stamps.
    """

    particles: Annotated[int, Bounds(ge=1)] = 200
    """Largest number of poses in a message of the belief."""

    class Out(Outputs):
        """Nothing: the file is the result."""

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[Shown | None] | None = None,
        map: AnyMap | None = None,
        commands: Sequence[Command | None] | None = None,
    ) -> Out:
        """The whole run at once."""
        if ctx.folder is None:
            return self.Out()
        remaining: Iterator[Shown | None] = iter(beliefs if beliefs is not None else [])
        with LogWriter(ctx.folder / "result.mcap") as log:
            stamp = 0
            for part in drive.by_log:
                self._write_drive(log, part, remaining, map)
                stamp = int(part.stamps[-1])
            if isinstance(map, ViewMixtures) and len(map):
                log.write("/map", "visualization_msgs/msg/MarkerArray", stamp, mixture_markers(map, stamp))
            for at, command in zip(drive.stamps.tolist(), commands or (), strict=bool(commands)):
                if command is not None:
                    twist = {"linear": {"x": command.speed}, "angular": {"z": command.turning}}
                    fields = {"header": header(at, "base_link"), "twist": twist}
                    log.write("/command", "geometry_msgs/msg/TwistStamped", at, fields)
        return self.Out()

    def _write_drive(self, log: LogWriter, drive: Drive, beliefs: Iterator[Shown | None], map: AnyMap | None) -> None:
        first, last = int(drive.stamps[0]), int(drive.stamps[-1])
        if isinstance(map, ReferenceGraph) and len(map):
            log.write("/map", "visualization_msgs/msg/MarkerArray", first, map_markers(map, first))
        odometry = drive.odometry_alone()
        own = None if odometry is None else drive.odometry()
        if odometry is not None and own is not None:
            transform = {"header": header(first), "child_frame_id": "odom", "transform": _transform(odometry[0])}
            log.write("/tf", "tf2_msgs/msg/TFMessage", first, {"transforms": [transform]})
        has_estimate, has_truth = known(drive.estimate), known(drive.truth)
        for row, stamp in enumerate(drive.stamps.tolist()):
            if own is not None:
                fields = {"header": header(stamp, "odom"), "child_frame_id": "base_link"}
                log.write("/odom", "nav_msgs/msg/Odometry", stamp, fields | {"pose": {"pose": ros_pose(own[row])}})
            if has_truth[row]:
                fields = {"header": header(stamp), "pose": ros_pose(drive.truth[row])}
                log.write("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", stamp, fields)
            if has_estimate[row]:
                pose = {"pose": ros_pose(drive.estimate[row]), "covariance": covariance_6x6(drive.covariance[row])}
                fields = {"header": header(stamp), "pose": pose}
                log.write("/estimate/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", stamp, fields)
            belief = next(beliefs, None)
            if isinstance(belief, Particles):
                fields = {"header": header(stamp), "poses": pose_messages(thin(belief, self.particles).poses)}
                log.write("/belief", "geometry_msgs/msg/PoseArray", stamp, fields)
            elif belief is not None:
                belief = heaviest(belief, self.particles)
                fields = {"header": header(stamp), "poses": pose_messages(belief.means)}
                log.write("/belief", "geometry_msgs/msg/PoseArray", stamp, fields)
                marker = _gaussians(
                    stamp, "belief", (0.8, 0.47, 0.65), belief.means, belief.covariances, belief.weights
                )
                log.write("/belief/gaussians", "visualization_msgs/msg/MarkerArray", stamp, {"markers": [marker]})
        poses = [
            {"header": header(int(stamp)), "pose": ros_pose(pose)}
            for stamp, pose in zip(drive.stamps[has_estimate], drive.estimate[has_estimate], strict=True)
        ]
        if poses:
            log.write("/estimate/path", "nav_msgs/msg/Path", last, {"header": header(last), "poses": poses})


def header(stamp: int, frame: str = FRAME) -> Fields:
    """A std_msgs/Header; `stamp` in nanoseconds."""
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": frame}


def ros_pose(pose: Array) -> Fields:
    """A geometry_msgs/Pose of x, y, heading, on the floor."""
    return {"position": _point(pose[0], pose[1]), "orientation": _rotation(pose[2])}


def pose_messages(poses: Array) -> list[Any]:
    """Many poses (N, 3) as message objects: ten times as fast as mappings, and beliefs are most of the log."""
    types = standard_types().types
    pose, point, quaternion = (types[f"geometry_msgs/msg/{name}"] for name in ("Pose", "Point", "Quaternion"))
    halves = poses[:, 2] / 2
    rows = zip(poses[:, :2].tolist(), np.sin(halves).tolist(), np.cos(halves).tolist(), strict=True)
    return [pose(point(x, y, 0.0), quaternion(0.0, 0.0, sin, cos)) for (x, y), sin, cos in rows]


def covariance_6x6(plane: Array) -> Array:
    """ROS' row-major 6 x 6 covariance (x, y, z, roll, pitch, yaw) of a (3, 3) over (x, y, heading): (36,)."""
    whole = np.zeros((6, 6))
    axes = np.array([0, 1, 5])
    whole[np.ix_(axes, axes)] = plane
    return whole.ravel()


def map_markers(map: ReferenceGraph, stamp: int) -> Fields:
    """References as points and edges as a list of lines (visualization_msgs/MarkerArray)."""
    points = [_point(x, y) for x, y in map.poses[:, :2].tolist()]
    ends = [points[reference] for reference in map.edges.ravel().tolist()]
    return {
        "markers": [
            _marker(stamp, "references", 8, 0.12, (0.35, 0.4, 0.45, 1.0), points),
            _marker(stamp, "edges", 5, 0.03, (0.65, 0.68, 0.72, 1.0), ends),
        ]
    }


def mixture_markers(map: ViewMixtures, stamp: int) -> Fields:
    """A map of mixtures (visualization_msgs/MarkerArray): its places as points, their ellipses as two axes each."""
    colour = (0.35, 0.4, 0.45)
    places = _marker(stamp, "places", 8, 0.1, (*colour, 1.0), _points(map.means[:, :2]))
    places["colors"] = _colours(colour, map.weights)
    return {"markers": [places, _gaussians(stamp, "ellipses", colour, map.means, map.covariances, map.weights)]}


def _gaussians(
    stamp: int, namespace: str, colour: tuple[float, float, float], means: Array, covariances: Array, weights: Array
) -> Fields:
    """Gaussians (K, …) as a list of lines: the two axes of each, one standard deviation to either side."""
    spread, axes = np.linalg.eigh(covariances[:, :2, :2])
    arms = np.swapaxes(axes * np.sqrt(np.maximum(spread, 0.0))[:, None, :], 1, 2)  # (K, axis, xy)
    ends = means[:, None, None, :2] + np.stack([-arms, arms], axis=2)
    marker = _marker(stamp, namespace, 5, 0.02, (*colour, 1.0), _points(ends.reshape(-1, 2)))
    marker["colors"] = _colours(colour, np.repeat(weights, 4))
    return marker


def _points(places: Array) -> list[Any]:
    point = standard_types().types["geometry_msgs/msg/Point"]
    return [point(x, y, 0.0) for x, y in places.tolist()]


def _colours(colour: tuple[float, float, float], weights: Array) -> list[Any]:
    rgba = standard_types().types["std_msgs/msg/ColorRGBA"]
    return [rgba(*colour, weight) for weight in np.clip(weights, 0.1, 1.0).tolist()]


def _marker(stamp: int, namespace: str, kind: int, size: float, colour: tuple[float, ...], points: list[Any]) -> Fields:
    return {
        "header": header(stamp),
        "ns": namespace,
        "type": kind,
        "pose": {"orientation": _rotation(0.0)},
        "scale": {"x": size, "y": size, "z": size},
        "color": dict(zip("rgba", colour, strict=True)),
        "points": points,
    }


def _point(x: float, y: float) -> Fields:
    return {"x": float(x), "y": float(y), "z": 0.0}


def _rotation(heading: float) -> Fields:
    return {"x": 0.0, "y": 0.0, "z": float(np.sin(heading / 2)), "w": float(np.cos(heading / 2))}


def _transform(pose: Array) -> Fields:
    translation = _point(pose[0], pose[1])
    return {"translation": translation, "rotation": _rotation(pose[2])}
