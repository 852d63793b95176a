"""A map's own images, each located by the landmarks of the others."""

import numpy as np
import pytest
from landmark_tour import room, seen_from, tour_poses

from omninav.stages.geometry.landmarks.left_out import VARIANCE_FACTOR, left_out_poses, samples_of
from omninav.stages.geometry.landmarks.map_making import (
    fitting_matches,
    local_views,
    mean_descriptors,
    pair_matches,
    tracks_of,
    triangulated,
)

SIGMA = np.radians(0.1)


def left_out(noise_m: float, number: int | None = None):
    """A tour whose bearings are off by `SIGMA` in each direction, and whose references by `noise_m`."""
    true, rng = tour_poses()[:number], np.random.default_rng(0)
    features = [seen_from(room(), pose) for pose in true]
    bearings = [each.bearings + SIGMA * rng.normal(size=each.bearings.shape) for each in features]
    bearings = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in bearings]
    views = local_views(bearings, [each.descriptors for each in features])
    pairs = [(a, b) for a in range(len(true)) for b in range(a) if 0.3 < np.hypot(*(true[a] - true[b])[:2]) < 2.0]
    matches = pair_matches(views, np.array(pairs))
    poses = true + rng.normal(size=true.shape) * [noise_m, noise_m, 0.0]
    tracks = tracks_of(views, matches, fitting_matches(views, matches, poses))
    sightings = triangulated(views, tracks, poses)
    candidates = [np.flatnonzero(np.arange(len(true)) != reference) for reference in samples_of(len(true))]
    return left_out_poses(views, sightings, mean_descriptors(views, sightings), poses, SIGMA, candidates)


def test_independent_bearings_leave_errors_of_their_own_size_and_wrong_poses_larger_ones() -> None:
    exact, wrong = left_out(0.0), left_out(0.01)
    assert exact.found_rate == wrong.found_rate == 1.0
    assert 1.0 <= exact.variance_factor < 2.5
    # 1 cm where the bearings of some hundred points tell a pose to 1 mm
    assert wrong.variance_factor > 10.0 * exact.variance_factor


def test_of_a_few_images_no_factor_is_measured() -> None:
    assert left_out(0.01, 6).variance_factor == pytest.approx(VARIANCE_FACTOR)
