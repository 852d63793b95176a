import numpy as np
import pytest
from small_run import collected
from world_files import world_of

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.metrics.error_curves import ErrorCurves, lap_ends
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose


def circle(laps: float, per_lap: int = 40, radius: float = 5.0) -> np.ndarray:
    """Poses around a circle, starting at the origin."""
    turn = 2 * np.pi * np.arange(round(laps * per_lap)) / per_lap
    return np.stack([radius * np.sin(turn), radius * (1 - np.cos(turn)), turn], axis=1)


def curves(truth: np.ndarray, errors: np.ndarray, stretched: float = 1.0, logs: list[int] | None = None):
    """Of a drive whose estimates lie so many metres beside the truth, and whose odometry stretches each step."""
    steps = [None, *[Motion(*map(float, step)) for step in between(truth[:-1], truth[1:]) * [stretched, stretched, 1]]]
    poses = [Pose(*map(float, row)) for row in truth]
    estimates = [
        PoseEstimate(Pose(pose.x + float(error), pose.y, pose.heading), np.eye(3), 1.0, pose)
        for pose, error in zip(poses, errors, strict=True)
    ]
    ticks = [Tick(i, i * 10**9, log, i) for i, log in enumerate(logs or [0] * len(truth))]
    return ErrorCurves().step(Context("curves"), collected(ticks, poses, steps, estimates)).metrics.values


def test_a_lap_ends_where_the_path_is_nearest_to_its_start_again():
    start = np.zeros(3)
    assert lap_ends(circle(3), start, 2.0) == [40, 80]
    assert lap_ends(circle(3.5), start, 2.0) == [40, 80, 120]
    assert lap_ends(circle(0.5), start, 2.0) == []
    assert lap_ends(np.zeros((9, 3)), start, 2.0) == []


def test_who_comes_back_past_the_start_to_leave_by_the_other_side_has_not_ended_a_lap():
    along = np.concatenate([np.arange(20), np.arange(20, -20, -1), np.arange(-20, 20)]).astype(float)
    there_and_back = np.stack([along, 0 * along, np.where(np.gradient(along) < 0, np.pi, 0.0)], axis=1)
    assert lap_ends(there_and_back, there_and_back[0], 2.0) == [80]


def test_the_seven_laps_around_the_shelves_are_seven_though_the_first_is_driven_by_either_side():
    truth = SimulatedRecording(world_of("home_store_small"), "laps", 0).truth
    ends = lap_ends(truth, truth[0], 2.0)
    assert np.diff([0, *ends, len(truth)]) / len(truth) == pytest.approx([0.255, *[0.124] * 6], abs=0.002)


def test_each_lap_has_its_own_errors():
    errors = np.repeat([0.4, 0.2, 0.1], 40)
    laps = curves(circle(3), errors)["laps"]
    assert [lap["frames"] for lap in laps] == [40, 40, 40]
    assert [lap["position_error_m"]["mean"] for lap in laps] == pytest.approx([0.4, 0.2, 0.1])
    assert [lap["odometry_error_m"]["mean"] for lap in laps] == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)


def test_over_the_steps_each_entry_is_the_mean_of_its_share(monkeypatch):
    monkeypatch.setattr("omninav.stages.metrics.error_curves.POINTS", 4)
    found = curves(circle(1), np.arange(40.0))["over_steps"]
    assert found["step"] == [4.5, 14.5, 24.5, 34.5]
    assert found["position_error_m"] == pytest.approx([4.5, 14.5, 24.5, 34.5])


def test_over_the_distance_odometry_is_that_of_the_first_lap(monkeypatch):
    monkeypatch.setattr("omninav.stages.metrics.error_curves.STEP_M", 2.0)
    straight = np.zeros((7, 3))
    straight[:, 0] = np.arange(7.0)
    found = curves(straight, np.zeros(7), stretched=1.1)["over_distance"]
    assert found["distance_m"] == [1.0, 3.0, 5.0, 7.0]
    assert found["first_lap_odometry_error_m"] == pytest.approx([0.05, 0.25, 0.45, 0.6])
    one, three = (curves(circle(laps), np.zeros(40 * laps), stretched=1.1)["over_distance"] for laps in (1, 3))
    assert one["first_lap_odometry_error_m"] == pytest.approx(three["first_lap_odometry_error_m"])


def test_no_frame_at_a_distance_is_no_error_there():
    jump = np.zeros((4, 3))
    jump[:, 0] = [0.0, 0.5, 2.5, 2.6]
    assert curves(jump, np.ones(4))["over_distance"]["position_error_m"] == [1.0, None, 1.0]


def test_the_last_log_is_drawn_and_nothing_without_truth():
    found = curves(circle(2), np.repeat([1.0, 0.5], 40), logs=[0] * 40 + [1] * 40)
    assert [lap["position_error_m"]["max"] for lap in found["laps"]] == pytest.approx([0.5])
    ticks = [Tick(i, i, 0, i) for i in range(3)]
    assert ErrorCurves().step(Context("curves"), collected(ticks, [None] * 3)).metrics.values == {}


def test_a_lap_is_told_by_mean_median_and_largest_error_of_place_and_heading():
    truth = np.add(circle(2), (7.0, -3.0, 0.0))
    errors = np.concatenate([np.full(40, 5.0), [1.0] * 30 + [2.0] * 9 + [4.0]])
    poses = [Pose(*map(float, row)) for row in truth]
    estimates = [
        PoseEstimate(Pose(pose.x, pose.y + float(off), pose.heading + 0.1 * float(off)), np.eye(3), 1.0, pose)
        for pose, off in zip(poses, errors, strict=True)
    ]
    ticks = [Tick(i, i, 0, i) for i in range(80)]
    found = ErrorCurves().step(Context("curves"), collected(ticks, poses, None, estimates)).metrics.values
    lap = found["laps"][1]
    assert lap["frames"] == 40
    assert lap["position_error_m"] == pytest.approx({"mean": 52 / 40, "median": 1.0, "max": 4.0})
    assert lap["heading_error_deg"]["mean"] == pytest.approx(np.degrees(0.1 * 52 / 40))
    assert lap["odometry_error_m"]["mean"] is None
    assert found["over_steps"]["odometry_error_m"] == [None] * 60
    assert found["over_distance"]["distance_m"][:10] == [0.5 + k for k in range(10)]


def test_frames_are_numbered_from_the_first_and_distances_are_from_the_first_true_pose(monkeypatch: pytest.MonkeyPatch):
    truth = [None, *[Pose(4.0 + x, 0.0, 0.0) for x in range(5)]]
    seen = [None, None, *[PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in truth[2:]]]
    motion = [None, None, *[Motion(1.5, 0.0, 0.0)] * 4]
    ticks = [Tick(i, i, 0, i) for i in range(6)]
    monkeypatch.setattr("omninav.stages.metrics.error_curves.POINTS", 2)
    monkeypatch.setattr("omninav.stages.metrics.error_curves.STEP_M", 2.0)
    stage = ErrorCurves()
    found = stage.step(Context("curves"), collected(ticks, truth, motion, seen)).metrics.values
    assert found["over_steps"]["step"] == [2.5, 4.5]
    assert found["over_steps"]["odometry_error_m"] == pytest.approx([0.75, 1.75])
    assert found["over_distance"]["distance_m"] == [1.0, 3.0, 5.0]
    assert found["over_distance"]["first_lap_odometry_error_m"] == pytest.approx([0.5, 1.25, 2.0])
    assert found["laps"][0]["odometry_error_m"]["mean"] == pytest.approx(1.25)


def test_what_was_never_estimated_has_no_curve_and_a_later_log_without_truth_is_not_drawn():
    pose = Pose(0.0, 0.0, 0.0)
    ticks = [Tick(i, i, i // 2, i % 2) for i in range(4)]
    assert ErrorCurves().step(Context("c"), collected(ticks[:2], [pose] * 2)).metrics.values == {}
    seen = [PoseEstimate(Pose(1.0 + k, 0.0, 0.0), np.eye(3), 1.0, pose) for k in range(4)]
    found = ErrorCurves().step(Context("c"), collected(ticks, [pose, pose, None, None], None, seen)).metrics.values
    assert found["laps"][0]["position_error_m"]["mean"] == 1.5


@pytest.mark.parametrize(
    ("path", "ends"),
    [
        ([0, 2, 4, 2, 0], []),  # not beyond twice the radius
        ([0, 2, 4.5, 2, 0], []),  # back, and not left again
        ([0, 2, 4.5, 2.25, 4.5], []),  # not near enough
        ([0, 2, 4.5, 2, 4.5], [3]),
        ([0, 4.5, 1, 0.5, 0.5, 1, 4.5, 1, 4.5], [3, 7]),  # the first of equals
    ],
)
def test_a_visit_begins_within_the_radius_and_ends_beyond_twice_that(path: list[float], ends: list[int]):
    poses = np.array([(x, 0.0, 0.0) for x in path])
    assert lap_ends(poses, poses[0], 2.0) == ends
    across = np.add(poses, (0.0, 0.0, np.pi / 2 + 0.01))
    assert lap_ends(across, poses[0], 2.0) == []
