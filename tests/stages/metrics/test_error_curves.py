import numpy as np
import pytest
from measured_drives import AT_ORIGIN, Row, figures, made_drive, on_x

from omninav.stages.geometry.plane.se2 import between
from omninav.stages.metrics.error_curves import ErrorCurves, lap_ends

MODULE = "omninav.stages.metrics.error_curves"


def circle(laps: float, per_lap: int = 40, radius: float = 5.0) -> np.ndarray:
    """Poses around a circle, starting at the origin."""
    turn = 2 * np.pi * np.arange(round(laps * per_lap)) / per_lap
    return np.stack([radius * np.sin(turn), radius * (1 - np.cos(turn)), turn], axis=1)


def curves(truth: np.ndarray, errors: np.ndarray, stretched: float = 1.0, logs: list[int] | None = None):
    """Of a drive whose estimates lie so many metres beside the truth, and whose odometry stretches each step."""
    motion: list[Row] = [None, *between(truth[:-1], truth[1:]) * [stretched, stretched, 1]]
    believed = truth + np.outer(errors, (1.0, 0.0, 0.0))
    return figures(ErrorCurves(), made_drive(truth, believed, motion, logs))


def along_x(*xs: float) -> np.ndarray:
    return np.array(on_x(xs))


def test_over_the_steps_each_entry_is_the_mean_of_its_share(monkeypatch):
    monkeypatch.setattr(f"{MODULE}.POINTS", 4)
    found = curves(circle(1), np.arange(40.0))["over_steps"]
    assert found["step"] == [4.5, 14.5, 24.5, 34.5]
    assert found["position_error_m"] == pytest.approx([4.5, 14.5, 24.5, 34.5])


def test_over_the_distance_odometry_is_that_of_the_first_lap(monkeypatch):
    monkeypatch.setattr(f"{MODULE}.STEP_M", 2.0)
    found = curves(along_x(*range(7)), np.zeros(7), stretched=1.1)["over_distance"]
    assert found["distance_m"] == [1.0, 3.0, 5.0, 7.0]
    assert found["first_lap_odometry_error_m"] == pytest.approx([0.05, 0.25, 0.45, 0.6])
    one, three = (curves(circle(laps), np.zeros(40 * laps), stretched=1.1)["over_distance"] for laps in (1, 3))
    assert one["first_lap_odometry_error_m"] == pytest.approx(three["first_lap_odometry_error_m"])


def test_no_frame_at_a_distance_is_no_error_there():
    found = curves(along_x(0.0, 0.5, 2.5, 2.6), np.ones(4))
    assert found["over_distance"]["position_error_m"] == [1.0, None, 1.0]


def test_the_last_log_with_truth_is_drawn():
    found = curves(circle(2), np.repeat([1.0, 0.5], 40), logs=[0] * 40 + [1] * 40)
    assert [lap["position_error_m"]["max"] for lap in found["laps"]] == pytest.approx([0.5])
    drive = made_drive([AT_ORIGIN] * 2 + [None] * 2, on_x([1.0, 2.0, 3.0, 4.0]), logs=[0, 0, 1, 1])
    assert figures(ErrorCurves(), drive)["laps"][0]["position_error_m"]["mean"] == 1.5


@pytest.mark.parametrize("truth", [None, AT_ORIGIN])
def test_without_truth_or_estimates_there_is_no_curve(truth):
    assert figures(ErrorCurves(), made_drive([truth] * 3)) == {}


def test_a_lap_is_told_by_mean_median_and_largest_error_of_place_and_heading():
    truth = np.add(circle(2), (7.0, -3.0, 0.0))
    errors = np.concatenate([np.full(40, 5.0), [1.0] * 30 + [2.0] * 9 + [4.0]])
    found = figures(ErrorCurves(), made_drive(truth, truth + np.outer(errors, (0.0, 1.0, 0.1))))
    assert found["laps"][1] == {
        "frames": 40,
        "position_error_m": pytest.approx({"mean": 52 / 40, "median": 1.0, "max": 4.0}),
        "heading_error_deg": pytest.approx({"mean": np.degrees(0.1 * 52 / 40)}),
        "odometry_error_m": {"mean": None},
    }
    assert found["over_steps"]["odometry_error_m"] == [None] * 60
    assert found["over_distance"]["distance_m"][:10] == [0.5 + k for k in range(10)]


def test_frames_are_numbered_from_the_first_and_distances_are_from_the_first_true_pose(monkeypatch: pytest.MonkeyPatch):
    truth = on_x([None, 4.0, 5.0, 6.0, 7.0, 8.0])
    monkeypatch.setattr(f"{MODULE}.POINTS", 2)
    monkeypatch.setattr(f"{MODULE}.STEP_M", 2.0)
    drive = made_drive(truth, [None, None, *truth[2:]], [None, None, *[(1.5, 0.0, 0.0)] * 4])
    found = figures(ErrorCurves(), drive)
    assert found["over_steps"]["step"] == [2.5, 4.5]
    assert found["over_steps"]["odometry_error_m"] == pytest.approx([0.75, 1.75])
    assert found["over_distance"]["distance_m"] == [1.0, 3.0, 5.0]
    assert found["over_distance"]["first_lap_odometry_error_m"] == pytest.approx([0.5, 1.25, 2.0])
    assert found["laps"][0]["odometry_error_m"]["mean"] == pytest.approx(1.25)


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
    poses = along_x(*path)
    assert lap_ends(poses, poses[0]) == ends
    across = np.add(poses, (0.0, 0.0, np.pi / 2 + 0.01))
    assert lap_ends(across, poses[0]) == []
