"""The lifecycle node, configured and activated as it starts, and started again where it crashes."""

from typing import List  # noqa: UP035  launch knows this one alone

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue
from omninav_ros.parameters import AUTOSTART, OVERRIDES, PARAMETERS


def generate_launch_description() -> LaunchDescription:
    """Each parameter of the node is an argument: `ros2 launch omninav_ros omninav.launch.py --show-args`."""
    arguments = {name: (str, default, description) for name, (_, default, description) in PARAMETERS.items()}
    arguments["overrides"] = (List[str], "['']", OVERRIDES)  # noqa: UP006
    arguments["autostart_node"] = (bool, "true", AUTOSTART)
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (_, default, description) in arguments.items()
    ]
    values = {
        name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, (kind, _, _) in arguments.items()
    }
    node = LifecycleNode(
        package="omninav_ros",
        executable="omninav_node",
        name="omninav",
        namespace="",
        output="screen",
        respawn=True,
        respawn_delay=2.0,
        parameters=[values],
    )
    return LaunchDescription([*declared, node])
