"""A robot of another process over zenoh: it says its odometry until it has heard a command; a pose was sent before."""

from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.live.transport import connect

transport = connect("zenoh", 3)
transport.subscribe("/cmd_vel", "geometry_msgs/msg/Twist")
transport.subscribe("/pose", "geometry_msgs/msg/PoseStamped", latched=True)
while (before := transport.take(0.1)) is None:
    pass
while (heard := transport.take(0.1)) is None:
    odometry = encode_message("nav_msgs/msg/Odometry", {"child_frame_id": "base_link"}, 7)
    transport.publish("/odom", "nav_msgs/msg/Odometry", odometry)
print(heard.topic, heard.msgtype, heard.data.hex(), transport.offered().get("/pose"), before.data.hex(), flush=True)
