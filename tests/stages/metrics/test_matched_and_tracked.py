"""Matches and tracks of a made-up drive, whose angles to the epipolar plane are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from measured_drives import figures, made_drive
from two_views import unit

from omninav.stages.geometry.plane.se2 import between
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.metrics.matched_and_tracked import MatchedAndTracked
from omninav.stages.values.correspondences import Correspondences
from omninav.stages.values.homing import FOUND_AGAIN, LOST, MATCHED, TRACKED, HomingTarget, LocalMap, TrackedFeatures
from omninav.stages.values.local_features import LocalFeatures

HOME, AWAY, HALF, NEAR = (1.0, 1.0, 0.3), (4.0, 1.0, 2.0), (3.0, 1.4, 2.2), (1.4, 1.05, 0.4)
POSES = [HOME, AWAY, HALF, NEAR]
"""Where the target was seen, where the robot was carried to, and its way back."""
POINTS = np.random.default_rng(3).uniform((-4.0, -4.0, -1.0), (8.0, 6.0, 2.0), (400, 3))
ROWS = np.arange(1, 400, 2)
"""The target's features that maps are made of: every other one."""
N = len(ROWS)
SHUFFLED = np.random.default_rng(4).permutation(400)
"""In which order the robot's features are."""


def seen(pose, noise_deg=0.0, seed=0) -> np.ndarray:
    away = (POINTS - (pose[0], pose[1], 0.0)) @ turn_about_vertical(pose[2])
    noise = np.random.default_rng(seed).normal(size=away.shape)
    return unit(unit(away) + math.radians(noise_deg) * noise)


def described(bearings) -> LocalFeatures:
    n = len(bearings)
    nothing = np.zeros((n, 2)), np.zeros((n, 128), np.uint8), np.zeros((n, 3), np.float32), np.ones(n, np.float32)
    return LocalFeatures(bearings, *nothing)


class Run:
    """What a homing drive of 4 ticks collects: one map, made in the second."""

    def __init__(self, poses=POSES, match_noise=0.0, track_noise=0.0) -> None:
        self.poses = poses
        depths = np.linspace(1.0, 9.0, N)[:, None]
        self.places = depths * seen(poses[1])[ROWS]
        kinds = np.full(N, MATCHED)
        new = LocalMap(5, 0, "new", rows=ROWS, places=self.places, kinds=kinds, points=np.zeros((N, 2)))
        self.maps, self.tracks = [None, new], [None, None]
        for pose in poses[2:]:
            self.maps.append(replace(new, state="tracking", kinds=np.full(N, TRACKED)))
            self.tracks.append(self.track(seen(pose, track_noise, 7)[ROWS]))
        self.features = [described(seen(pose, match_noise, 5)[SHUFFLED]) for pose in poses]
        self.matches = Correspondences(np.argsort(SHUFFLED), np.arange(400), np.zeros(400))

    def track(self, bearings) -> TrackedFeatures:
        return TrackedFeatures(5, ROWS, np.full(N, TRACKED), np.zeros((N, 2)), bearings, self.places.copy())

    def judged(self):
        ticks = len(self.poses)
        targets = [HomingTarget(0, described(seen(self.poses[0])))] * ticks
        given = self.maps, self.tracks, targets, self.features, [self.matches] * ticks
        found = figures(MatchedAndTracked(), made_drive(self.poses), *given)
        return found and found["pairs"]


def test_exact_pairs_are_all_right_without_noise_and_of_the_images_they_are_said_to_be():
    found = Run().judged()
    for kind in ("matched", "tracked"):
        assert found[kind]["used"] == found[kind]["right"] == N
        assert found[kind]["noise_deg"] == pytest.approx(0.0, abs=1e-6)
    assert (found["maps"], found["kept"]) == (1, 1.0)
    assert found["matched"]["apart_m"] == pytest.approx(3.0)
    assert found["tracked"]["apart_m"] == pytest.approx(math.hypot(*between(AWAY, NEAR)[:2]))


def test_noise_in_one_of_two_views_is_shared_by_both():
    found = Run(match_noise=0.1, track_noise=0.2).judged()
    # The median of |N(0, s)| is 0.67 s, of which the noisy view has its share by how both lie to the baseline.
    assert 0.5 < found["matched"]["noise_deg"] / (0.67 * 0.1) < 0.85
    assert 0.5 < found["tracked"]["noise_deg"] / (0.67 * 0.2) < 0.85
    assert found["noise_ratio"] == found["matched"]["noise_deg"] / found["tracked"]["noise_deg"]


def test_tracks_that_are_lost_or_contradict_the_map_do_not_count():
    run = Run()
    run.tracks[-1].kinds[:4] = LOST
    run.tracks[-1].kinds[4] = FOUND_AGAIN
    run.maps[-1].kinds[5:11] = LOST
    found = run.judged()
    assert found["tracked"]["used"] == found["tracked"]["right"] == N - 10
    assert found["matched"]["right"] == N
    assert found["kept"] == (N - 10) / N


def test_a_feature_that_was_matched_anew_on_the_way_is_not_tracked():
    run = Run()
    run.tracks[-1].places[:3] *= 1.1
    assert run.judged()["tracked"]["used"] == N - 3


def test_wrong_pairs_are_used_and_not_right_and_their_angle_is_no_noise(monkeypatch: pytest.MonkeyPatch):
    run = Run()
    run.tracks[-1].bearings[:] = np.roll(run.tracks[-1].bearings, 1, axis=0)
    run.tracks[-1].bearings[50:] = seen(NEAR)[ROWS][50:]
    wrong = np.arange(400)
    wrong[ROWS] = np.roll(ROWS, 1)
    run.matches = replace(run.matches, first=np.argsort(SHUFFLED)[wrong])
    found = run.judged()
    assert found["matched"]["used"] == found["tracked"]["used"] == N
    assert N - 50 <= found["tracked"]["right"] < N - 25  # some lie on the plane by chance
    assert found["matched"]["right"] < N / 2
    monkeypatch.setattr("omninav.stages.metrics.matched_and_tracked.RIGHT_DEG", 90.0)
    assert run.judged()["tracked"]["right"] > found["tracked"]["right"]
    run.matches = replace(run.matches, first=np.argsort(SHUFFLED))
    assert run.judged()["tracked"]["noise_deg"] < 0.3


def test_a_map_that_was_lost_at_once_or_before_the_least_distance_has_no_tracks():
    run = Run()
    run.maps[2:] = [replace(each, state="lost") for each in run.maps[2:]]
    at_once = run.judged()
    too_near = Run(poses=[HOME, AWAY, (3.9, 1.1, 2.2), (3.8, 1.2, 2.2)]).judged()
    for found in (at_once, too_near):
        assert found["tracked"] == {"used": 0, "right": 0, "noise_deg": None, "apart_m": None}
        assert (found["matched"]["right"], found["kept"], found["noise_ratio"]) == (N, 0.0, None)


def test_counts_are_per_map():
    run = Run()
    again = replace(run.maps[1], number=6)
    run.maps[3] = again  # a second map, made in the last tick
    run.tracks[3] = None
    run.places = run.places.copy()
    found = run.judged()
    assert (found["maps"], found["tracked"]["used"], found["matched"]["used"]) == (2, N / 2, N)
    assert found["tracked"]["apart_m"] == pytest.approx(math.hypot(*between(AWAY, HALF)[:2]))


def test_without_a_map_or_truth_there_is_nothing():
    run = Run()
    run.maps[1] = None
    assert run.judged() is None
    assert figures(MatchedAndTracked(), made_drive([HOME, None]), *[[None, None]] * 5) is None


def test_a_map_made_where_the_target_is_has_no_epipolar_plane():
    assert Run(poses=[HOME, (1.1, 1.0, 0.3), HALF, NEAR]).judged() is None
