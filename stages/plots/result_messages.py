"""A tick of a run as ROS 2 messages, for its log and for whoever watches it."""

from dataclasses import field
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick
from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.recordings.pose_messages import (
    BASE,
    MAP,
    ODOM,
    covariance_6x6,
    header,
    path_message,
    pose_messages,
    ros_pose,
    transform,
)
from omninav.stages.values.belief import Belief, GaussianMixture, Particles, PlaceBelief, PoseEstimate
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import Array, pose_row
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.ros_messages import RosMessages
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.views import Neighbours
from omninav.stages.values.visual_distance import VisualDistances

from .grid_message import grid_message
from .markers import GREEN, PINK, gaussian_markers, homing_arrow, map_markers, weighted_points
from .panorama_snapshot import EncodedPanorama
from .thin_belief import heaviest, thin

PATH_POSES = 500
"""Most poses in the path so far; of a longer one every second, every fourth, … is shown."""
PATH_TICKS = 16
"""Ticks between two messages of the path so far; a power of two, as between views."""
VIEWS = frozenset(("/panorama/compressed", "/belief", "/belief/markers", "/similarity", "/homing", "/estimate/path"))
"""Topics that are only looked at, and fill a log. The others are small."""
SHOWN_REFERENCES = 50
"""Most references whose similarity is shown, the most similar ones."""


class ResultMessagesState(State):
    """What later ticks need of earlier ones: `odometry` (3,) since the log's first frame; `correction` (3,) from map to
    odometry, and whether it is `anchored`; the `path` so far (N, 3) with its `stamps` (N,), every `stride`-th tick's;
    the size of the map and the number of the route that were shown last; the `ticks` so far.
    """

    odometry: Array = field(default_factory=lambda: np.zeros(3))
    correction: Array = field(default_factory=lambda: np.zeros(3))
    anchored: bool = False
    path: Array = field(default_factory=lambda: np.zeros((0, 3)))
    stamps: list[int] = field(default_factory=list)
    stride: int = 1
    map_size: int = 0
    route: int = -1
    ticks: int = 0


class ResultMessages(Stage):
    """Makes the messages of `result.mcap` of each tick, from the inputs that are wired.

    | topic | message | holds |
    |---|---|---|
    | `/tf` | TFMessage | `map` to `odom` and `odom` to `base_link` |
    | `/odom` | Odometry | odometry alone, from the log's first frame, in the frame `odom` |
    | `/estimate/pose` | PoseWithCovarianceStamped | the estimate; 6 x 6 covariance, plane entries only |
    | `/estimate/confidence` | Float64 | probability that the estimate is right, in [0, 1] |
    | `/estimate/path` | Path | the estimates so far, every 16 ticks; all of a log's at its end |
    | `/ground_truth/pose` | PoseStamped | where the log has it |
    | `/belief` | PoseArray | few particles, a mixture's means, or the likely places |
    | `/belief/markers` | MarkerArray | a mixture's ellipses by their axes (one sigma), or the likely places |
    | `/map` | MarkerArray | references and edges, mixtures, or places with names |
    | `/grid` | OccupancyGrid | the floor plan or the grid, at a log's first frame |
    | `/similarity` | MarkerArray | the most similar references, as opaque as they are similar |
    | `/similarity/best` | Float64 | the largest similarity, in [0, 1] |
    | `/panorama/compressed` | CompressedImage | what the robot saw, small |
    | `/plan` | Path | the places of the planned route |
    | `/homing` | MarkerArray | the homing vector, from the robot |
    | `/command` | TwistStamped | what was commanded |

    The transform from `map` to `odom` is the estimate less odometry; without any estimate the first true pose is taken.
    `/map` comes at a log's first frame, whenever it has grown by a tenth, and at the end.
    Stamps are the tick's: the images' header stamps. Of `VisualDistances` d the similarity is 1 / (1 + d).
    """

    particles: Annotated[int, Bounds(ge=1)] = 100
    """Largest number of poses in a message of the belief."""
    max_views: Annotated[int, Bounds(ge=1)] = 2000
    """Ticks whose panorama, belief, similarities, homing vector and path so far are kept in a log: of a run of more
    ticks every second, every fourth, … Poses, transforms and commands are kept of every tick."""

    class Out(Outputs):
        """`messages`: of this tick. `kept`: those of them that a log keeps."""

        messages: RosMessages
        kept: RosMessages

    def step(
        self,
        ctx: Context,
        shown: ResultMessagesState,
        tick: Tick,
        motion: Motion | None = None,
        truth: Pose | None = None,
        estimate: PoseEstimate | None = None,
        belief: Belief | None = None,
        map: AnyMap | None = None,
        plan: FloorPlan | None = None,
        grid: OccupancyGrid | None = None,
        panorama: EncodedPanorama | None = None,
        similarities: Similarities | Neighbours | VisualDistances | None = None,
        route: PlannedRoute | None = None,
        vector: HomingVector | None = None,
        command: Command | None = None,
        confidence: PoseConfidence | None = None,
    ) -> Out:
        """One tick."""
        out = _Messages(tick.stamp)
        if tick.first_of_log:
            shown.odometry, shown.correction, shown.anchored = np.zeros(3), np.zeros(3), False
            shown.path, shown.stamps, shown.stride, shown.map_size = np.zeros((0, 3)), [], 1, 0
            floor = plan if grid is None else grid
            if floor is not None:
                out.add("/grid", "nav_msgs/msg/OccupancyGrid", grid_message(floor, tick.stamp))
        if map is not None and len(map) and len(map) > 1.1 * shown.map_size:
            shown.map_size = len(map)
            out.markers("/map", map_markers(map, tick.stamp)["markers"])
        self._show_poses(out, shown, tick, motion, truth, estimate)
        if confidence is not None:
            out.add("/estimate/confidence", "std_msgs/msg/Float64", {"data": confidence.probability})
        if belief is not None:
            self._show_belief(out, belief, estimate)
        if similarities is not None and map is not None:
            _show_similarities(out, similarities, map)
        if panorama is not None:
            data = np.frombuffer(panorama.jpeg, np.uint8)
            fields = {"header": header(tick.stamp, BASE), "format": "jpeg", "data": data}
            out.add("/panorama/compressed", "sensor_msgs/msg/CompressedImage", fields)
        if route is not None and isinstance(map, TopologicalMap) and route.number != shown.route:
            shown.route = route.number
            places = map.poses[map.places[route.places]]
            out.add("/plan", "nav_msgs/msg/Path", path_message([tick.stamp] * len(places), places, tick.stamp))
        if vector is not None:
            out.markers("/homing", [homing_arrow(tick.stamp, vector)])
        if command is not None:
            twist = {"linear": {"x": command.speed}, "angular": {"z": command.turning}}
            out.add("/command", "geometry_msgs/msg/TwistStamped", {"header": header(tick.stamp, BASE), "twist": twist})
        made = out.made(views_every=1 << (shown.ticks // self.max_views).bit_length())
        kept = made.without(VIEWS) if shown.ticks % made.views_every else made
        shown.ticks += 1
        return self.Out(messages=made, kept=kept)

    def _show_poses(
        self,
        out: "_Messages",
        shown: ResultMessagesState,
        tick: Tick,
        motion: Motion | None,
        truth: Pose | None,
        estimate: PoseEstimate | None,
    ) -> None:
        if motion is not None and not tick.first_of_log:
            shown.odometry = compose(shown.odometry, (motion.x, motion.y, motion.turn))
        if estimate is not None or (truth is not None and not shown.anchored):
            at = np.array(pose_row(truth if estimate is None else estimate.pose))
            shown.correction, shown.anchored = compose(at, between(shown.odometry, np.zeros(3))), True
        frames = [
            transform(tick.stamp, MAP, ODOM, shown.correction),
            transform(tick.stamp, ODOM, BASE, shown.odometry),
        ]
        out.add("/tf", "tf2_msgs/msg/TFMessage", {"transforms": frames})
        fields = {"header": header(tick.stamp, ODOM), "child_frame_id": BASE}
        out.add("/odom", "nav_msgs/msg/Odometry", fields | {"pose": {"pose": ros_pose(shown.odometry)}})
        if truth is not None:
            fields = {"header": header(tick.stamp), "pose": ros_pose(np.array(pose_row(truth)))}
            out.add("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", fields)
        if estimate is not None:
            row = np.array(pose_row(estimate.pose))
            pose = {"pose": ros_pose(row), "covariance": covariance_6x6(estimate.covariance)}
            fields = {"header": header(tick.stamp), "pose": pose}
            out.add("/estimate/pose", "geometry_msgs/msg/PoseWithCovarianceStamped", fields)
            if tick.frame % shown.stride == 0:
                shown.path, shown.stamps = np.vstack([shown.path, row]), [*shown.stamps, tick.stamp]
            if len(shown.path) > PATH_POSES:
                shown.path, shown.stamps, shown.stride = shown.path[::2], shown.stamps[::2], 2 * shown.stride
        if shown.stamps and shown.ticks and shown.ticks % PATH_TICKS == 0:
            fields = path_message(shown.stamps, shown.path, tick.stamp)
            out.add("/estimate/path", "nav_msgs/msg/Path", fields)

    def _show_belief(self, out: "_Messages", belief: Belief, estimate: PoseEstimate | None) -> None:
        if isinstance(belief, Particles):
            poses = thin(belief, self.particles).poses
        elif isinstance(belief, GaussianMixture):
            few = heaviest(belief, self.particles)
            poses = few.means
            spread = gaussian_markers(out.stamp, "belief", PINK, poses, few.covariances, few.weights)
            out.markers("/belief/markers", [spread])
        elif isinstance(belief, PlaceBelief):
            likely = np.argsort(-belief.probabilities, kind="stable")[: self.particles]
            likely = likely[belief.probabilities[likely] > 0.01]
            poses, weights = belief.poses[likely], belief.probabilities[likely]
            out.markers("/belief/markers", [weighted_points(out.stamp, "belief", PINK, 0.35, poses[:, :2], weights)])
        elif estimate is not None:
            poses = np.array([pose_row(estimate.pose)])
        else:
            return
        fields = {"header": header(out.stamp), "poses": pose_messages(poses)}
        out.add("/belief", "geometry_msgs/msg/PoseArray", fields)


def _show_similarities(out: "_Messages", found: Similarities | Neighbours | VisualDistances, map: AnyMap) -> None:
    places = map_poses(map)
    if isinstance(found, Similarities):
        rows = np.arange(len(found.values)) if found.candidates is None else found.candidates
        values = found.values.max(axis=1, initial=0.0).astype(np.float64)
    elif isinstance(found, Neighbours):
        rows, values = np.empty(0, np.int64), found.similarities  # a view is seen from several places
    else:
        rows, values = np.arange(len(found.distances)), 1.0 / (1.0 + found.distances)
        places = places[map.places] if isinstance(map, TopologicalMap) else places
    out.add("/similarity/best", "std_msgs/msg/Float64", {"data": float(values.max(initial=0.0))})
    if len(rows):
        best = np.argsort(-values, kind="stable")[:SHOWN_REFERENCES]
        at = places[rows[best], :2]
        out.markers("/similarity", [weighted_points(out.stamp, "similarity", GREEN, 0.2, at, values[best])])


class _Messages:
    """The messages of a tick, while they are made."""

    def __init__(self, stamp: int) -> None:
        self.stamp = stamp
        self._all: list[tuple[str, str, bytes]] = []

    def add(self, topic: str, msgtype: str, fields: Any) -> None:
        self._all.append((topic, msgtype, encode_message(msgtype, fields)))

    def markers(self, topic: str, markers: list[Any]) -> None:
        self.add(topic, "visualization_msgs/msg/MarkerArray", {"markers": markers})

    def made(self, views_every: int) -> RosMessages:
        topics, types, data = zip(*self._all, strict=True)
        return RosMessages(self.stamp, topics, types, data, views_every)
