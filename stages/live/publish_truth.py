"""Ground truth of a simulator as ROS 2 messages."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Stage, Tick
from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.plots.pose_messages import header, ros_pose
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.pose import Pose

from .transport import TransportName, connect


class PublishTruth(Stage):
    """Publishes the true pose on `/ground_truth/pose` and the number of collisions so far on `/collisions` (UInt32)."""

    transport: Literal["ros2"] | TransportName = "ros2"
    """As of the driver."""
    domain: Annotated[int, Bounds(ge=0, le=232)] | None = None
    """The ROS domain; null: `ROS_DOMAIN_ID`, else 0."""

    def setup(self, ctx: Context) -> None:
        """Join the domain."""
        self._transport = connect("rclpy" if self.transport == "ros2" else self.transport, self.domain)

    def step(self, ctx: Context, tick: Tick, truth: Pose, tally: EpisodeStatistics) -> None:
        fields = {"header": header(tick.stamp), "pose": ros_pose(np.array([truth.x, truth.y, truth.heading]))}
        pose = "geometry_msgs/msg/PoseStamped"
        self._transport.publish("/ground_truth/pose", pose, encode_message(pose, fields))
        number = encode_message("std_msgs/msg/UInt32", {"data": tally.collisions})
        self._transport.publish("/collisions", "std_msgs/msg/UInt32", number)
