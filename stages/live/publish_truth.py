"""Ground truth of a simulator as ROS 2 messages."""

import numpy as np

from omninav.pipeline import Context, Stage, Tick
from omninav.stages.plots.pose_messages import header, ros_pose
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.pose import Pose

from .publish import Publisher
from .transport import TransportName


class PublishTruth(Publisher, Stage):
    """Publishes the true pose on `/ground_truth/pose` and the number of collisions so far on `/collisions` (UInt32)."""

    transport: TransportName = "ros2"
    """As of the driver."""

    def step(self, ctx: Context, tick: Tick, truth: Pose, tally: EpisodeStatistics) -> None:
        fields = {"header": header(tick.stamp), "pose": ros_pose(np.array([truth.x, truth.y, truth.heading]))}
        self._send("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", fields)
        self._send("/collisions", "std_msgs/msg/UInt32", {"data": tally.collisions})
