"""Matches and tracks of a made-up drive, whose right angles to the epipolar plane are known."""

import math

import numpy as np
import pytest
from small_run import collected
from two_views import unit

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.metrics.matched_and_tracked import MatchedAndTracked
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import LOST, MATCHED, TRACKED, HomingTarget, LocalMap, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Pose

POSES = [(1.0, 1.0, 0.3), (4.0, 1.0, 2.0), (3.0, 1.4, 2.2), (1.1, 1.05, 0.4)]
"""Where the target was seen, where the robot was carried to, and its way back."""
POINTS = np.random.default_rng(3).uniform((-4.0, -4.0, -1.0), (8.0, 6.0, 2.0), (60, 3))


def seen(pose, noise_deg=0.0, seed=0, number=60) -> np.ndarray:
    away = (POINTS[:number] - (pose[0], pose[1], 0.0)) @ turn_about_vertical(pose[2])
    noise = np.random.default_rng(seed).normal(size=away.shape)
    return unit(unit(away) + math.radians(noise_deg) * noise)


def described(bearings) -> LocalFeatures:
    n = len(bearings)
    nothing = np.zeros((n, 2)), np.zeros((n, 128), np.uint8), np.zeros((n, 3), np.float32), np.ones(n, np.float32)
    return LocalFeatures(bearings, *nothing)


def pairs_of(poses=POSES, used=40, alive=20, match_noise=0.1, track_noise=0.3, wrong_tracks=0, number=1, state="new"):
    kinds = np.where(np.arange(used) < alive, TRACKED, LOST)
    rows, places = np.arange(used), 5.0 * seen(poses[1], 0.0, number=used)
    made = LocalMap(
        number, 0, state, rows=rows, places=places, kinds=np.full(used, MATCHED), points=np.zeros((used, 2))
    )
    maps, tracks = [None, made], [None, None]
    for pose in poses[2:]:
        bearings = seen(pose, track_noise, 7, used)
        bearings[:wrong_tracks] = np.roll(bearings[:wrong_tracks], 1, axis=0)
        bearings[kinds == LOST] = np.nan
        maps.append(LocalMap(number, 0, "tracking", rows=rows, places=places, kinds=kinds, points=np.zeros((used, 2))))
        tracks.append(TrackedFeatures(number, rows, kinds, np.zeros((used, 2)), bearings, places))
    target = HomingTarget(0, described(seen(poses[0])))
    features = [described(seen(pose, match_noise, 5)) for pose in poses]
    all_rows = np.arange(60)
    matches = [Correspondences(all_rows, all_rows, np.zeros(60))] * len(poses)
    drive = collected([Tick(k, k * 10**9) for k in range(len(poses))], [pose and Pose(*pose) for pose in poses])
    found = MatchedAndTracked().step(Context("pairs"), drive, maps, tracks, [target] * len(poses), features, matches)
    return found.metrics and found.metrics.values["pairs"]


def test_it_counts_what_the_map_was_made_of_and_what_is_still_tracked_in_the_end():
    found = pairs_of()
    assert found["matched"]["used"] == found["matched"]["right"] == 40
    assert found["tracked"]["used"] == found["tracked"]["right"] == 20
    assert found["more"] == 2.0


def test_noise_is_the_angle_to_the_true_epipolar_plane():
    exact = pairs_of(match_noise=0.0, track_noise=0.0)
    assert exact["matched"]["noise_deg"] == pytest.approx(0.0, abs=1e-6)
    assert exact["tracked"]["noise_deg"] == pytest.approx(0.0, abs=1e-6)
    some = pairs_of(match_noise=0.1, track_noise=0.2, alive=40)
    # The median of |N(0, s)| is 0.67 s; one view of the two is noisy, and both share the blame: at most that.
    assert 0.02 < some["matched"]["noise_deg"] < 0.07
    assert some["tracked"]["noise_deg"] == pytest.approx(2.0 * some["matched"]["noise_deg"], rel=0.6)
    assert some["noise_ratio"] == some["matched"]["noise_deg"] / some["tracked"]["noise_deg"] < 1.0


def test_a_wrong_track_is_used_but_not_right():
    found = pairs_of(wrong_tracks=10, track_noise=0.0)["tracked"]
    assert found["used"] == 20
    assert 10 <= found["right"] < 20  # one that lies on the plane by chance passes


def test_the_images_are_those_the_pairs_are_of():
    found = pairs_of()
    assert found["matched"]["apart_m"] == pytest.approx(3.0)
    assert found["tracked"]["apart_m"] == pytest.approx(math.hypot(*between(POSES[1], POSES[3])[:2]))


def test_without_a_track_in_the_end_there_is_nothing_to_compare_with():
    found = pairs_of(alive=0)
    assert found["tracked"] == {"used": 0, "right": 0, "noise_deg": None, "apart_m": pytest.approx(2.9, abs=0.01)}
    assert found["more"] is None
    assert found["noise_ratio"] is None
    assert found["matched"]["right"] == 40


def test_a_map_that_is_tracked_no_further_than_30_cm_is_left_out():
    assert pairs_of(poses=[*POSES[:2], (3.9, 1.1, 2.2), (3.8, 1.2, 2.2)]) is None


def test_without_a_map_there_is_nothing():
    assert pairs_of(state="lost") is None


def test_without_truth_there_is_nothing():
    drive = collected([Tick(k, k) for k in range(2)], [Pose(*POSES[0]), None])
    assert MatchedAndTracked().step(Context("pairs"), drive, *[[None, None]] * 5).metrics is None


def test_a_map_made_where_the_target_is_has_no_epipolar_plane():
    assert pairs_of(poses=[POSES[0], (1.1, 1.0, 0.3), *POSES[2:]]) is None
