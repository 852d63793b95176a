"""Settings that stand once and reach every node that needs them."""

import pytest

import omninav

NAVIGATION = ("topological_nav", "world=office", "goal=kitchen")
LIVE = ("particle_cml", "source=live", "log=live", "publish=ros2", "camera=equirectangular")


def nodes_of(*words: str) -> dict:
    return omninav.compose(*words).settings["nodes"]


def test_the_robots_geometry_and_limits_reach_all_nodes_that_drive_it() -> None:
    nodes = nodes_of(*NAVIGATION, "robot.radius_m=0.4", "robot.max_angular_speed=0.5", "robot.max_speed=0.3")
    assert [nodes[name]["robot_radius_m"] for name in ("control", "stall_monitor", "wander")] == [0.4] * 3
    assert [nodes[name]["max_angular_speed"] for name in ("control", "wander")] == [0.5] * 2
    assert nodes["control"]["max_speed"] == 0.3
    one = nodes_of(*NAVIGATION, "nodes.control.robot_radius_m=0.3")
    assert [one[name]["robot_radius_m"] for name in ("control", "wander")] == [0.3, 0.25]


@pytest.mark.parametrize("words", [(), ("world=office",)])
def test_a_simulated_robot_has_its_worlds_radius_and_brakes(words: tuple[str, ...]) -> None:
    assert nodes_of("wander", *words)["control"]["robot_radius_m"] == 0.25
    assert nodes_of("wander", *words, "world.robot.radius=0.3")["control"]["robot_radius_m"] == 0.3
    assert nodes_of("wander", *words, "world.robot.acceleration=2.0")["control"]["deceleration"] == 2.0


def test_frames_and_domain_reach_all_nodes_that_speak_to_the_robot() -> None:
    nodes = nodes_of(*LIVE, "robot.domain=7", "robot.odom_frame=wheels", "robot.base_frame=base")
    assert {nodes[name]["domain"] for name in ("source", "publish", "publish_belief", "publish_messages")} == {7}
    assert [nodes["publish"][name] for name in ("map_frame", "odom_frame", "base_frame")] == ["map", "wheels", "base"]


def test_the_robots_limits_reach_what_publishes_commands() -> None:
    publish = nodes_of(*LIVE, "robot.max_speed=0.3", "robot.max_angular_speed=0.5")["publish"]
    assert (publish["max_speed"], publish["max_angular_speed"]) == (0.3, 0.5)


def test_the_confidence_and_its_calibration_have_one_tolerance() -> None:
    nodes = nodes_of("omniview_mcl", "tolerance.metres=0.3", "tolerance.degrees=20")
    for name in ("monitor", "wrong_pose_agreement", "calibration"):
        assert (nodes[name]["within_m"], nodes[name]["within_deg"]) == (0.3, 20)
