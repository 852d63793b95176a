"""Messages of a live run to the robot and to all who watch, every tick."""

import time
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Stage, Tick
from omninav.pipeline.mcap.message_types import encode_message, standard_types
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.plots.pose_messages import (
    BASE,
    MAP,
    ODOM,
    Fields,
    covariance_6x6,
    header,
    pose_messages,
    ros_pose,
    transform,
)
from omninav.stages.values.belief import GaussianMixture, Particles, PoseEstimate
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.pose import Pose
from omninav.stages.values.ros_messages import RosMessages

from .transport import Transport, TransportError, TransportName, connect, full_name
from .watchdog import Watchdog

POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
POSE_ARRAY = "geometry_msgs/msg/PoseArray"
TF = "tf2_msgs/msg/TFMessage"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN = 0, 1
PARTICLE, PARTICLE_CLOUD = "nav2_msgs/msg/Particle", "nav2_msgs/msg/ParticleCloud"
NAV2 = {
    PARTICLE: "geometry_msgs/Pose pose\nfloat64 weight\n",
    PARTICLE_CLOUD: "std_msgs/Header header\nnav2_msgs/Particle[] particles\n",
}
"""Definitions of nav2's messages, which do not come with ROS."""


@dataclass(kw_only=True, eq=False)
class Publisher:
    """Joins a robot's domain: a mixin, beside `Stage`."""

    transport: TransportName = "dds"
    """As the source's."""
    domain: Annotated[int, Bounds(ge=0, le=232)] | None = None
    """The ROS domain; null: `ROS_DOMAIN_ID`, else 0."""

    def setup(self, ctx: Context) -> None:
        self._transport: Transport = connect(self.transport, self.domain)

    def _send(self, topic: str, msgtype: str, fields: Fields, latched: bool = False) -> None:
        send(self._transport, topic, msgtype, encode_message(msgtype, fields), latched)


class Publish(Publisher, Stage):
    """Publishes the pose, `map -> odom` and the command over ROS 2, before anything that can wait.

    The command is published as it was computed in this tick, within the robot's limits; zero where there was none, once
    more zero when the run ends, and by a watchdog thread when no tick has ended within two periods. A topic whose
    parameter is null is not published; one whose type the transport does not have is left out and reported in
    diagnostics, as are inputs that do not fit each other, for as long as they do not. A robot that searches or is lost
    has no pose: none is published, and with the old transform a navigation stack stops.
    """

    pose: str | None = "/estimate/pose"
    """The estimate (PoseWithCovarianceStamped, latched); `/amcl_pose` takes AMCL's place."""
    unsure: bool = False
    """Publishes the pose and the transform of a robot that searches or is lost too: the best guess."""
    tf: str | None = "/tf"
    """Topic of the transform `map_frame -> odom_frame`: the estimate over the odometry as the robot reports it, which
    starts over where it is reset."""
    tf_tolerance_s: Annotated[float, Bounds(ge=0)] = 1.0
    """Time by which the transform is dated ahead of the image, so that it holds until the next one: as AMCL's."""
    map_frame: str = MAP
    """The map's frame."""
    odom_frame: str = ODOM
    """Odometry's frame."""
    base_frame: str = BASE
    """The robot's frame, for commands with a header."""
    command: str | None = "/cmd_vel"
    """Topic on which the robot takes commands."""
    command_type: Literal["TwistStamped", "Twist"] = "TwistStamped"
    """As Nav2 has them since Kilted, or without a header."""
    max_speed: Annotated[float, Bounds(gt=0)] = 0.4
    """Greatest speed that is commanded (m/s), whatever a controller asks for."""
    max_angular_speed: Annotated[float, Bounds(gt=0)] = 0.8
    """Greatest turning speed that is commanded, rad/s."""

    def setup(self, ctx: Context) -> None:
        super().setup(ctx)
        self._watchdog: Watchdog | None = None
        self._stamps: list[int] = []

    def step(
        self,
        ctx: Context,
        tick: Tick,
        estimate: PoseEstimate | None = None,
        odometry: Pose | None = None,
        command: Command | None = None,
        conflicts: Conflicts | None = None,
        confidence: PoseConfidence | None = None,
        route: PlannedRoute | None = None,
    ) -> None:
        """Publish what there is. Nothing while a record is made again."""
        if not self._transport.status.live:
            return
        if self.command is not None and (command is not None or self._watchdog is not None):
            self._drive(tick.stamp, self._limited(ctx, command or Command(0.0, 0.0)))
        if estimate is not None:
            self._transport.status.spread_m = float(np.sqrt(max(0.0, np.trace(estimate.covariance[:2, :2]))))
        if confidence is not None:
            self._transport.status.note("state", "" if confidence.state == "tracking" else confidence.state)
        if estimate is not None and (self.unsure or confidence is None or confidence.is_sure):
            self._publish_estimate(tick.stamp, estimate, odometry)
        if conflicts is not None:
            self._transport.status.note("conflicts", "; ".join(conflicts.standing))
        if route is not None:
            given_up = f"the goal was given up: {route.why}" if route.state == "gave up" else ""
            self._transport.status.note("route", given_up)
        self._transport.status.published(tick.stamp)

    def _publish_estimate(self, stamp: int, estimate: PoseEstimate, odometry: Pose | None) -> None:
        at = np.array(pose_row(estimate.pose))
        if self.pose is not None:
            pose = {"pose": ros_pose(at), "covariance": covariance_6x6(estimate.covariance)}
            self._send(self.pose, POSE, {"header": header(stamp, self.map_frame), "pose": pose}, latched=True)
        if self.tf is not None and odometry is not None:
            until = stamp + round(self.tf_tolerance_s * 1e9)
            correction = compose(at, between(pose_row(odometry), np.zeros(3)))
            self._send(self.tf, TF, {"transforms": [transform(until, self.map_frame, self.odom_frame, correction)]})

    def _limited(self, ctx: Context, command: Command) -> Command:
        speed = max(-self.max_speed, min(self.max_speed, command.speed))
        turning = max(-self.max_angular_speed, min(self.max_angular_speed, command.turning))
        if (speed, turning) != (command.speed, command.turning):
            asked = f"{command.speed:g} m/s and {command.turning:g} rad/s"
            ctx.count("limited_command", detail=f"{asked} exceed robot.max_speed or robot.max_angular_speed")
        return Command(speed, turning)

    def _drive(self, stamp: int, command: Command) -> None:
        if self._watchdog is None:
            self._watchdog = Watchdog(self._halt)
            self._transport.farewells.append(self._watchdog.close)
        self._stamps = [*self._stamps[-10:], stamp]
        periods = np.diff(self._stamps) / 1e9
        self._command(stamp, command)
        if command.speed == 0.0 and command.turning == 0.0:
            self._watchdog.rest()
        else:
            self._watchdog.feed(2 * float(np.median(periods)) if len(periods) else 1.0)

    def _halt(self) -> None:
        self._command(self._stamps[-1], Command(0.0, 0.0))

    def _command(self, stamp: int, command: Command) -> None:
        assert self.command is not None
        twist = {"linear": {"x": float(command.speed)}, "angular": {"z": float(command.turning)}}
        stamped = {"header": header(stamp, self.base_frame), "twist": twist}
        fields: Fields = stamped if self.command_type == "TwistStamped" else twist
        self._send(self.command, f"geometry_msgs/msg/{self.command_type}", fields)


class PublishBelief(Publisher, Stage):
    """Publishes the belief in few poses over ROS 2, after the pose itself."""

    topic: str | None = "/belief"
    """The belief in few poses; null: it is not published."""
    message: Literal["PoseArray", "ParticleCloud"] = "PoseArray"
    """Type of the message: geometry_msgs/PoseArray, or nav2_msgs/ParticleCloud with weights."""
    map_frame: str = MAP
    """The map's frame."""

    def step(self, ctx: Context, tick: Tick, belief: Particles | GaussianMixture | None = None) -> None:
        """One tick. `belief`: thinned. Nothing while a record is made again."""
        if self.topic is not None and belief is not None and self._transport.status.live:
            kind, fields = self._message(belief)
            self._send(self.topic, kind, {"header": header(tick.stamp, self.map_frame)} | fields)

    def _message(self, belief: Particles | GaussianMixture) -> tuple[str, Fields]:
        poses = pose_messages(belief.poses if isinstance(belief, Particles) else belief.means)
        if self.message == "PoseArray":
            return POSE_ARRAY, {"poses": poses}
        register_nav2()
        particle = standard_types().types[PARTICLE]
        weighted = [particle(pose, weight) for pose, weight in zip(poses, belief.weights.tolist(), strict=True)]
        return PARTICLE_CLOUD, {"particles": weighted}


class PublishMessages(Publisher, Stage):
    """Publishes what else a run shows of each tick, latched: the path, the map, the route (`nodes.messages.topics`)."""

    grid: str = "/grid"
    """Topic on which the grid is published: nav2 reads its map on `/map`."""

    def step(self, ctx: Context, messages: RosMessages) -> None:
        if self._transport.status.live:
            for topic, msgtype, data in zip(messages.topics, messages.types, messages.data, strict=True):
                send(self._transport, self.grid if topic == "/grid" else topic, msgtype, data, latched=True)


def register_nav2() -> None:
    """Add nav2's messages to those that come with ROS."""
    from rosbags.typesys import get_types_from_msg

    types = standard_types()
    if PARTICLE_CLOUD not in types.fielddefs:
        for msgtype, definition in NAV2.items():
            types.register(get_types_from_msg(definition, msgtype))


def send(transport: Transport, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
    """Publish a message; where that cannot be, report why and leave the topic out from then on."""
    if topic in transport.status.left_out:
        return
    try:
        name = full_name(topic)
        transport.publish(name, msgtype, data, latched)
        transport.status.sent.add(name)
    except TransportError as error:
        transport.status.left_out[topic] = str(error)


def publish_diagnostics(transport: Transport, topic: str) -> None:
    """Publish the transport's status: latency, rate, what was left out, and every trouble in words."""
    status = transport.status
    troubles = "; ".join(sorted(status.troubles.values()))
    values = {"rate_hz": f"{status.rate_hz:.2f}", "spread_m": f"{status.spread_m:.3f}"}
    if status.latencies_ms is not None:
        values["latency_ms.median"], values["latency_ms.p95"] = (f"{each:.1f}" for each in status.latencies_ms)
    if status.age_ms is not None:
        values["age_ms.median"] = f"{status.age_ms:.1f}"
    values |= {kind: str(number) for kind, number in sorted(status.counts.items())}
    values |= {f"left out: {what}": why for what, why in sorted(status.left_out.items())}
    state = {
        "level": WARN if troubles else OK,
        "name": "omninav",
        "message": troubles or "running",
        "hardware_id": "",
        "values": [{"key": key, "value": value} for key, value in values.items()],
    }
    send(transport, topic, DIAGNOSTICS, encode_message(DIAGNOSTICS, {"status": [state]}, time.time_ns()))
