"""Keeps the few numbers of a tick from which its messages can be made on demand."""

from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Shape, Stage, State, Tick, Value
from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.plots.pose_messages import path_bytes
from omninav.stages.values.belief import Belief, GaussianMixture, Particles, PlaceBelief, PoseEstimate
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import pose_row
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
from .markers import arrow_length, map_markers
from .panorama_snapshot import EncodedPanorama
from .thin_belief import heaviest, thin

SHOWN_REFERENCES = 50
"""Most references whose similarity is shown, the most similar ones."""
LIKELY_PLACE = 0.01
"""Probability above which a place is shown."""
ROW = np.dtype(
    [
        ("motion", np.float64, 3),
        ("truth", np.float64, 3),
        ("estimate", np.float64, 3),
        ("covariance", np.float64, (3, 3)),
        ("confidence", np.float64),
        ("best_similarity", np.float64),
        ("command", np.float64, 2),
        ("homing", np.float64, 2),
    ]
)
"""Meaning of `ShownTick.numbers`: poses (x, y, heading), the covariance of the estimate, probabilities in [0, 1], speed
and turning (m/s, rad/s), direction (rad) and length (m) of the homing arrow."""
_ABSENT = {name: (np.nan,) * (ROW[name].itemsize // 8) for name in ROW.names or ()}


class ShownTick(Value):
    """Values shown of a tick. `numbers`: a row of `ROW`, NaN where there is none.

    `belief` (K, 3): poses of the belief; of a mixture with their `covariances`, of places and of a mixture with their
    `weights`. `similar` (M, 3): x, y (m) and similarity of the most similar references, the most similar first.
    `jpeg`: the panorama. `made`: messages that come seldom, as they are. One of `views_every` ticks
    keeps what is only looked at: belief, similar references, panorama and homing arrow.
    """

    bulky = True

    tick: Tick
    numbers: Array
    belief: Annotated[Array | None, Shape("K", 3)] = None
    covariances: Annotated[Array | None, Shape("K", 3, 3)] = None
    weights: Annotated[Array | None, Shape("K")] = None
    similar: Annotated[Array | None, Shape("M", 3)] = None
    jpeg: bytes | None = None
    made: RosMessages | None = None
    views_every: int = 1

    def without_views(self) -> "ShownTick":
        """The same without what is only looked at."""
        numbers = self.numbers.copy()
        numbers.view(ROW)["homing"] = np.nan
        return replace(self, numbers=numbers, belief=None, covariances=None, weights=None, similar=None, jpeg=None)


class ShowTickState(State):
    """Size of the map, number of the route and tracking state that were shown last; the `ticks` so far."""

    map_size: int = 0
    route: int = -1
    state: str = ""
    ticks: int = 0


class ShowTick(Stage):
    """Keeps what `result.mcap` and live viewers show of each tick, from the inputs that are wired.

    No message is made here but the few that come seldom: `/grid` at a log's first frame, `/map` there and whenever the
    map has grown by a tenth, `/plan` with each new route, `/estimate/state` with each new one. `ResultMessages` lists
    them all.
    """

    particles: Annotated[int, Bounds(ge=1)] = 100
    """Largest number of poses that are shown of the belief."""
    max_views: Annotated[int, Bounds(ge=1)] = 2000
    """Ticks whose panorama, belief, similarities, homing vector and path so far are kept in a log: of a run of more
    ticks every second, every fourth, … Poses, transforms and commands are kept of every tick."""

    class Out(Outputs):
        """`shown`: of this tick. `kept`: the part of it that a log keeps."""

        shown: ShownTick
        kept: ShownTick

    def step(
        self,
        ctx: Context,
        before: ShowTickState,
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
        similar, best = None, np.nan
        if similarities is not None and map is not None:
            similar, best = _shown_references(similarities, map)
        numbers = np.array(
            (
                *(_ABSENT["motion"] if motion is None else (motion.x, motion.y, motion.turn)),
                *pose_row(truth),
                *pose_row(None if estimate is None else estimate.pose),
                *(_ABSENT["covariance"] if estimate is None else np.asarray(estimate.covariance).ravel()),
                np.nan if confidence is None else confidence.probability,
                best,
                *(_ABSENT["command"] if command is None else (command.speed, command.turning)),
                *(_ABSENT["homing"] if vector is None else (vector.direction, arrow_length(vector))),
            )
        )
        shown = ShownTick(
            tick,
            numbers,
            *self._belief(belief, estimate),
            similar,
            None if panorama is None else panorama.jpeg,
            self._seldom(before, tick, map, plan if grid is None else grid, route, confidence),
            1 << (before.ticks // self.max_views).bit_length(),
        )
        kept = shown.without_views() if before.ticks % shown.views_every else shown
        before.ticks += 1
        return self.Out(shown=shown, kept=kept)

    def _seldom(
        self,
        before: ShowTickState,
        tick: Tick,
        map: AnyMap | None,
        floor: FloorPlan | OccupancyGrid | None,
        route: PlannedRoute | None,
        confidence: PoseConfidence | None,
    ) -> RosMessages | None:
        made: list[tuple[str, str, bytes]] = []

        def add(topic: str, msgtype: str, fields: Any) -> None:
            made.append((topic, msgtype, encode_message(msgtype, fields)))

        if tick.first_of_log:
            before.map_size, before.state = 0, ""
            if floor is not None:
                add("/grid", "nav_msgs/msg/OccupancyGrid", grid_message(floor, tick.stamp))
        if map is not None and len(map) > 1.1 * before.map_size:
            before.map_size = len(map)
            add("/map", "visualization_msgs/msg/MarkerArray", map_markers(map, tick.stamp))
        if confidence is not None and confidence.state != before.state:
            before.state = confidence.state
            add("/estimate/state", "std_msgs/msg/String", {"data": confidence.state})
        if route is not None and map is not None and route.number != before.route:
            before.route = route.number
            places = map_poses(map)[map.places[route.places] if isinstance(map, TopologicalMap) else route.places]
            if route.goal is not None:  # a point beside the references
                places = np.vstack([places, (route.goal.x, route.goal.y, 0.0)])
            path = path_bytes(np.full(len(places), tick.stamp), places, tick.stamp)
            made.append(("/plan", "nav_msgs/msg/Path", path))
        return RosMessages.of(tick.stamp, made) if made else None

    def _belief(
        self, belief: Belief | None, estimate: PoseEstimate | None
    ) -> tuple[Array | None, Array | None, Array | None]:
        """Poses, covariances and weights."""
        if isinstance(belief, Particles):
            return thin(belief, self.particles).poses, None, None
        if isinstance(belief, GaussianMixture):
            few = heaviest(belief, self.particles)
            return few.means, few.covariances, few.weights
        if isinstance(belief, PlaceBelief):
            likely = np.argsort(-belief.probabilities, kind="stable")[: self.particles]
            likely = likely[belief.probabilities[likely] > LIKELY_PLACE]
            return belief.poses[likely], None, belief.probabilities[likely]
        if belief is not None and estimate is not None:
            return np.array([pose_row(estimate.pose)]), None, None
        return None, None, None


def _shown_references(found: Similarities | Neighbours | VisualDistances, map: AnyMap) -> tuple[Array | None, float]:
    """Places of the most similar references, with their similarities (M, 3); and the largest similarity.

    Of `VisualDistances` d the similarity is 1 / (1 + d).
    """
    if isinstance(found, Neighbours):  # a view is seen from several places
        return None, float(found.similarities.max(initial=0.0))
    rows: Ints | None
    if isinstance(found, Similarities):
        values, rows = found.best.astype(np.float64), found.candidates
    else:
        values, rows = 1.0 / (1.0 + found.distances), map.places if isinstance(map, TopologicalMap) else None
    if not len(values):
        return None, 0.0
    best = (-values).argsort(kind="stable")[:SHOWN_REFERENCES]
    similar = np.empty((len(best), 3))
    similar[:, :2] = map_poses(map)[best if rows is None else rows[best], :2]
    similar[:, 2] = values[best]
    return similar, max(0.0, float(values[best[0]]))
