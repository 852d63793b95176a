"""A robot's driver: what its sensors give goes out as ROS 2 messages, and commands come in."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, State, Tick, write_whole
from omninav.pipeline.mcap.message_types import standard_types
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import interpolate
from omninav.stages.plots.pose_messages import BASE, ODOM, header, ros_pose, transform
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.messages import scan_fields
from omninav.stages.values.command import Command
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.scan import Scan

from .publish import Publisher
from .transport import TransportName

CAMERA = "omni_camera"
TWISTS = ("geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/Twist")
NOTE_S = 5.0
"""Seconds between two notes of how it goes."""
COMMAND_S = 0.5
"""Time that a command holds, seconds: without another one the robot then stops."""
ODOMETRY_HZ = 20.0
"""Odometry messages a second; between ticks the pose is interpolated."""


@dataclass(frozen=True)
class CameraStop:
    """The camera is silent from `at` on (s since the start), for `seconds`."""

    at: Annotated[float, Bounds(ge=0)]
    seconds: Annotated[float, Bounds(gt=0)]


@dataclass(frozen=True)
class ClockJump:
    """The robot's clock leaps `by` seconds at `at` (s since the start); back where that is negative."""

    at: Annotated[float, Bounds(ge=0)]
    by: float


class RobotDriverState(State):
    """`first`: stamp of the first tick (ns). `odometry` (3,) and `stamp` of the tick before. `command` (2,) as it came
    last, m/s and rad/s, and the stamp at which it did."""

    first: int = 0
    stamp: int = 0
    odometry: Array = field(default_factory=lambda: np.zeros(3))
    command: Array = field(default_factory=lambda: np.zeros(2))
    commanded: int | None = None


class RobotDriver(Publisher, Stage):
    """Publishes images, odometry, ranges, transforms and the clock, and takes commands, as a robot's own driver does.

    | topic | message |
    |---|---|
    | `/camera/image/compressed`, `/camera/camera_info` | CompressedImage (JPEG), CameraInfo |
    | `/odom` | Odometry, in the frame `odom` |
    | `/scan` | LaserScan |
    | `/tf`, `/tf_static` | `odom` to `base_link`; `base_link` to `omni_camera` |
    | `/clock` | Clock |
    | `/cmd_vel` (read) | Twist or TwistStamped, whichever is published |

    Stamps are this computer's time at the first tick, and run with the ticks from there on. In real time the command
    for the next tick is what has come when the tick is over; it holds until another comes, for `COMMAND_S` at most.
    """

    transport: TransportName = "ros2"
    """`ros2` (or `rclpy`): a sourced ROS 2, or omninav[ros2]. Without ROS: `dds`, omninav[live], or `zenoh`,
    omninav[zenoh]."""
    real_time: bool = True
    """A second takes a second, where the computer is fast enough; else ticks follow each other at once."""
    command_topic: str = "/cmd_vel"
    """Topic from which commands come."""
    camera_file: str | None = None
    """File for the camera's description for `omninav live camera=…`: a mirror does not fit CameraInfo."""
    camera_stops: tuple[CameraStop, ...] = ()
    """When the camera fails, for trials."""
    clock_jumps: tuple[ClockJump, ...] = ()
    """When the clock leaps, for trials."""

    class Out(Outputs):
        """`command`: what holds until the next tick. `tick`: with the stamp that was published."""

        command: Command | None = None
        tick: Tick

    def setup(self, ctx: Context) -> None:
        super().setup(ctx)
        self._started = self._worked = self._free = 0.0
        self._offset, self._noted = 0, (0.0, 0.0)
        self._subscribed = ""

    def step(
        self,
        ctx: Context,
        robot: RobotDriverState,
        tick: Tick,
        camera: Camera,
        odometry: Pose,
        image: Image | None = None,
        motion: Motion | None = None,
        scan: Scan | None = None,
    ) -> Out:
        """Publish one tick when its time has come, and wait for the command that is to be driven next."""
        if not self._started:
            self._begin(robot, tick, camera)
        seconds = (tick.stamp - robot.first) / 1e9
        period = (tick.stamp - robot.stamp) / 1e9 if robot.stamp else 0.0
        self._worked = 0.9 * self._worked + 0.1 * max(0.0, time.monotonic() - self._free) if robot.stamp else 0.0
        self._wait(ctx, robot, seconds, tick.stamp)
        leaps = sum(jump.by for jump in self.clock_jumps if jump.at <= seconds)
        stamp = tick.stamp + self._offset + round(leaps * 1e9)
        self._publish(robot, tick.stamp, stamp - tick.stamp, odometry, motion, scan)
        if image is not None and not any(stop.at <= seconds < stop.at + stop.seconds for stop in self.camera_stops):
            self._publish_image(stamp + camera.delay_ns, image)  # as late as its reader takes it to be
        self._note(ctx, seconds)
        robot.stamp, robot.odometry = tick.stamp, np.array([odometry.x, odometry.y, odometry.heading])
        self._wait(ctx, robot, seconds + period - 1.5 * self._worked, tick.stamp)
        self._free = time.monotonic()
        fresh = robot.commanded is not None and tick.stamp - robot.commanded < COMMAND_S * 1e9
        speed, turning = robot.command.tolist()
        command = Command(speed, turning) if fresh else None
        return self.Out(command=command, tick=Tick(tick.index, stamp, first_of_log=tick.first_of_log, frame=tick.frame))

    def _begin(self, robot: RobotDriverState, tick: Tick, camera: Camera) -> None:
        if self.camera_file is not None:
            path, text = Path(self.camera_file), write_camera(camera)
            if path.exists() and path.read_bytes() != text.encode():
                raise BadInput(
                    f"camera={path}: it is there, and not this world's camera; type another name, or delete it"
                )
            write_whole(path, text)
        robot.first = robot.first or tick.stamp
        self._started = self._free = time.monotonic() - (tick.stamp - robot.first) / 1e9
        self._offset = time.time_ns() - tick.stamp
        size = {"width": camera.width, "height": camera.height_px}
        self._info = {"header": {"frame_id": CAMERA}, **size, **camera.camera_info()}
        fixed = transform(tick.stamp + self._offset, BASE, CAMERA, camera.mount)
        fixed["transform"]["translation"]["z"] = camera.height or 0.0
        self._send("/tf_static", "tf2_msgs/msg/TFMessage", {"transforms": [fixed]}, latched=True)

    def _wait(self, ctx: Context, robot: RobotDriverState, seconds: float, now: int) -> None:
        """Until that much time has passed since the start; commands are taken meanwhile. `now`: stamp of the tick."""
        if not self._subscribed:
            offered = self._transport.offered().get(self.command_topic, "")
            if offered in TWISTS:
                self._transport.subscribe(self.command_topic, offered)
                self._subscribed = offered
        while True:
            left = self._started + seconds - time.monotonic() if self.real_time else 0.0
            message = self._transport.take(max(0.0, left))
            if message is not None:
                try:
                    decoded = standard_types().deserialize_cdr(message.data, message.msgtype)
                except Exception as error:  # damaged bytes raise whatever the generated decoder stumbles over
                    ctx.count("bad_message", detail=f"{self.command_topic}: no {message.msgtype} ({error!s:.120})")
                    continue
                twist: Any = getattr(decoded, "twist", decoded)
                speed, turning = twist.linear.x, twist.angular.z
                if math.isfinite(speed) and math.isfinite(turning):
                    robot.command, robot.commanded = np.array([speed, turning]), now
                else:
                    ctx.count("impossible_command", detail=f"{self.command_topic}: {speed} m/s, {turning} rad/s")
            elif left <= 0.0:
                if left < -1.0:
                    self._started -= left  # too slow by a second: from here on time is counted again
                return

    def _publish(
        self, robot: RobotDriverState, now: int, shift: int, odometry: Pose, motion: Motion | None, scan: Scan | None
    ) -> None:
        stamp = now + shift
        clock = {"sec": stamp // 10**9, "nanosec": stamp % 10**9}
        self._send("/clock", "rosgraph_msgs/msg/Clock", {"clock": clock})
        seconds = (now - robot.stamp) / 1e9 if robot.stamp else 1.0
        twist = {"linear": {"x": motion.x / seconds}, "angular": {"z": motion.turn / seconds}} if motion else {}
        for at, pose in self._odometry(robot, now, np.array([odometry.x, odometry.y, odometry.heading])):
            frames = {"header": header(at + shift, ODOM), "child_frame_id": BASE}
            moving = {"pose": {"pose": ros_pose(pose)}, "twist": {"twist": twist}}
            self._send("/odom", "nav_msgs/msg/Odometry", frames | moving)
            self._send("/tf", "tf2_msgs/msg/TFMessage", {"transforms": [transform(at + shift, ODOM, BASE, pose)]})
        if scan is not None:
            self._send("/scan", "sensor_msgs/msg/LaserScan", {"header": header(stamp, BASE)} | scan_fields(scan))

    def _odometry(self, robot: RobotDriverState, now: int, pose: Array) -> Iterator[tuple[int, Array]]:
        """Stamps and poses since the tick before, up to this one."""
        steps = max(1, round(ODOMETRY_HZ * (now - robot.stamp) / 1e9)) if robot.stamp else 1
        shares = np.arange(1, steps + 1) / steps
        poses = interpolate(np.array([0.0, 1.0]), np.stack([robot.odometry, pose]), shares) if steps > 1 else [pose]
        for share, row in zip(shares.tolist(), poses, strict=True):
            yield now - round((1.0 - share) * (now - robot.stamp)) if steps > 1 else now, row

    def _publish_image(self, stamp: int, image: Image) -> None:
        _, packed = cv2.imencode(".jpg", image.pixels, [cv2.IMWRITE_JPEG_QUALITY, 90])
        self._send("/camera/camera_info", "sensor_msgs/msg/CameraInfo", self._info | {"header": header(stamp, CAMERA)})
        fields = {"header": header(stamp, CAMERA), "format": "jpeg", "data": packed.ravel()}
        self._send("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", fields)

    def _note(self, ctx: Context, seconds: float) -> None:
        """Every few seconds, report how fast time passes and whether anybody commands."""
        now, (before, then) = time.monotonic(), self._noted
        if now - then > NOTE_S:
            speed = f", {(seconds - before) / (now - then):.2f} times real time" if then else ""
            obeys = f"obeys {self.command_topic}" if self._subscribed else f"nobody publishes {self.command_topic}"
            status = self._transport.status
            ctx.status("; ".join([f"{seconds:.0f} s{speed}", obeys, *status.troubles.values(), *status.news()]))
            self._noted = seconds, now
