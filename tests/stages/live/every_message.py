"""Publishes every message of every option of `publish`, over one transport, until it is killed: `TRANSPORT PARAMETERS`.

`PARAMETERS`: JSON, a list of one mapping for each option: node -> its parameters.
"""

import json
import sys
import time

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.live.publish import Publish, PublishBelief, PublishMessages, publish_diagnostics
from omninav.stages.live.transport import connect
from omninav.stages.plots.grid_message import grid_message
from omninav.stages.plots.markers import homing_arrow, map_markers
from omninav.stages.plots.pose_messages import path_bytes
from omninav.stages.values.belief import Particles, PoseEstimate
from omninav.stages.values.command import Command
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose
from omninav.stages.values.ros_messages import RosMessages

STAMP = 1_700_000_000_250_000_000
TICK = Tick(3, STAMP, frame=3)
ESTIMATE = PoseEstimate(Pose(3.0, 1.0, np.pi / 2), np.diag([0.04, 0.09, 0.01]), 0.75, Pose(2.5, 1.5, np.pi / 2))
ODOMETRY = Pose(1.0, 2.0, np.pi)
COMMAND = Command(0.25, -0.5)
BELIEF = Particles(np.array([[3.0, 1.0, np.pi / 2], [2.0, -1.0, 0.0]]), np.array([0.75, 0.25]))
MAP = ReferenceGraph(
    np.array([[0.5, 1.5, 0.0], [2.5, 3.5, 0.0]]), np.zeros((2, 1, 1), np.float32), "none", np.array([[0, 1]]), "truth"
)
GRID = OccupancyGrid(np.array([[0, 1, 2]], np.uint8), 0.5, (1.0, -2.0))
SHOWN = {
    "/estimate/path": ("nav_msgs/msg/Path", path_bytes([STAMP], np.array([[3.0, 1.0, np.pi / 2]]), STAMP)),
    "/estimate/confidence": ("std_msgs/msg/Float64", {"data": 0.875}),
    "/estimate/state": ("std_msgs/msg/String", {"data": "lost"}),
    "/map": ("visualization_msgs/msg/MarkerArray", map_markers(MAP, STAMP)),
    "/grid": ("nav_msgs/msg/OccupancyGrid", grid_message(GRID, STAMP)),
    "/plan": ("nav_msgs/msg/Path", path_bytes([STAMP] * 2, MAP.poses, STAMP)),
    "/homing": (
        "visualization_msgs/msg/MarkerArray",
        {"markers": [homing_arrow(STAMP, 0.5, 1.5)]},
    ),
}
"""Messages of `result.mcap` that are published, by topic: type, and fields or bytes."""


def messages(topics: list[str]) -> RosMessages:
    content = [SHOWN[topic] for topic in topics]
    data = [each if isinstance(each, bytes) else encode_message(msgtype, each) for msgtype, each in content]
    return RosMessages(STAMP, tuple(topics), tuple(msgtype for msgtype, _ in content), tuple(data))


class Told:
    """The stages of all options of `publish`, and what makes them tell all that they can."""

    def __init__(self, transport: str, options: list[dict[str, dict[str, object]]]) -> None:
        self.transport = connect(transport)
        self.transport.status.live = True
        self.transport.status.note("/odom", "nothing on /odom")
        kinds = {"publish": Publish, "publish_belief": PublishBelief, "publish_messages": PublishMessages}
        named = [(name, given, each) for each in options for name, given in each.items() if name in kinds]
        self.stages = [kinds[name](**{**given, "transport": transport}) for name, given, _ in named]
        self.topics = [each["messages"]["topics"] if "messages" in each else [] for _, _, each in named]
        for stage in self.stages:
            stage.setup(Context("publish"))

    def tell(self) -> None:
        for stage, topics in zip(self.stages, self.topics, strict=True):
            if isinstance(stage, Publish):
                stage.step(Context("publish"), TICK, estimate=ESTIMATE, odometry=ODOMETRY, command=COMMAND)
                if stage._watchdog is not None:
                    stage._watchdog.rest()  # all ticks have one stamp: it would say zero between them
            elif isinstance(stage, PublishBelief):
                stage.step(Context("publish"), TICK, belief=BELIEF)
            else:
                stage.step(Context("publish"), messages(topics))
        publish_diagnostics(self.transport, "/diagnostics")


if __name__ == "__main__":
    told = Told(sys.argv[1], json.loads(sys.argv[2]))
    while True:
        told.tell()
        print(json.dumps({"left_out": told.transport.status.left_out}), flush=True)
        time.sleep(0.3)
