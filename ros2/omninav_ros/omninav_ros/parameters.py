"""The node's parameters, which are settings of `omninav live`; the node and the launch file declare them from here."""

PARAMETERS = {
    "variant": ("variant", "omninav", "Variant that runs; `omninav variants` lists them."),
    "map": ("map", "", "Saved map (.omap) that a tour has left. Empty: the variant makes one."),
    "camera": ("camera", "", "A camera.yaml, or a projection (equirectangular, …). Empty: the robot's CameraInfo."),
    "topics.image": ("topics.image", "", "Image or CompressedImage that is read."),
    "topics.camera_info": ("topics.camera_info", "", "CameraInfo that is read."),
    "topics.odometry": ("topics.odometry", "", "Odometry that is read."),
    "topics.scan": ("topics.scan", "", "LaserScan that is read."),
    "topics.initial_pose": ("nodes.source.initial_pose", "", "PoseWithCovarianceStamped at which the belief restarts."),
    "topics.goal": ("nodes.source.goal", "", "PoseStamped to which a variant that drives is sent."),
    "topics.restart": ("nodes.source.restart", "", "Topic (std_msgs/Empty), and service, that restart the belief."),
    "topics.pose": ("nodes.publish.pose", "", "PoseWithCovarianceStamped that is published."),
    "topics.tf": ("nodes.publish.tf", "", "TFMessage that is published: map to odom."),
    "topics.command": ("nodes.publish.command", "", "TwistStamped that is published by a variant that drives."),
    "topics.diagnostics": ("nodes.source.diagnostics", "", "DiagnosticArray that is published."),
}
"""ROS parameter -> (omninav's setting, default, description). Texts; an empty one leaves the setting as it is."""

OVERRIDES = "Further settings of `omninav live`, each as it is typed: start=origin, publish=amcl."
"""Description of the parameter `overrides`, a list of texts."""
AUTOSTART = "Configures and activates the node as it starts, with no manager."
"""Description of the parameter `autostart_node`, as nodes of navigation2 have it."""
