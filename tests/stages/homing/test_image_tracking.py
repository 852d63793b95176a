"""Points that are followed from one small image to the next."""

import cv2
import numpy as np
import pytest

from omninav.pipeline import BadInput
from omninav.stages.homing.image_tracking import best_nearby, find_again, histograms, track, trackability
from omninav.stages.homing.working_image import SEAM, WorkingImage, working_image
from omninav.stages.values.image import Image, Panorama

RNG = np.random.default_rng(4)
TEXTURE = cv2.GaussianBlur(RNG.integers(0, 256, (90, 360, 3), dtype=np.uint8), (0, 0), 2.0)
TEXTURE = cv2.normalize(TEXTURE, None, 0, 255, cv2.NORM_MINMAX)


def panorama(shift: int = 0) -> WorkingImage:
    """A full circle, turned by so many columns."""
    return working_image(Panorama(np.roll(TEXTURE, shift, axis=1), 0.7, -0.7), None, 360 * 90)


def test_a_full_circle_is_repeated_beyond_both_edges():
    image = panorama()
    assert (image.seam, image.columns) == (SEAM, 360)
    np.testing.assert_array_equal(image.grey[:, :SEAM], image.grey[:, 360 : 360 + SEAM])


def test_a_larger_image_is_made_small_and_points_go_there_and_back():
    image = working_image(Panorama(TEXTURE, 0.7, -0.7), None, 360 * 90 // 4)
    assert image.grey.size <= 360 * 90 // 4 + 2 * SEAM * image.grey.shape[0] + 360
    points = np.array([[10.0, 5.0], [100.0, 30.0]])
    np.testing.assert_allclose(image.to_original(points), (points + 0.5) * 2.0 - 0.5)
    np.testing.assert_allclose(image.from_original(image.to_original(points)), points)
    rays = image.bearings(points)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    np.testing.assert_allclose(image.points(3.0 * rays), points, atol=1e-6)


def test_an_image_without_its_camera_is_refused():
    with pytest.raises(BadInput, match="without its camera"):
        working_image(Image(TEXTURE), None, 1000)


def test_points_are_followed_through_a_turn_also_across_the_edge():
    before, after = panorama(), panorama(6)
    strength = trackability(before)
    points = best_nearby(strength, before, np.array([[40.0, 45.0], [180.0, 30.0], [357.0, 50.0]]))
    found, kept = track(before.grey, after, points, points)
    assert kept.all()
    np.testing.assert_allclose(found[:, 1], points[:, 1], atol=0.1)
    np.testing.assert_allclose((found[:, 0] - points[:, 0]) % 360, 6.0, atol=0.1)


def test_a_point_whose_surroundings_are_gone_is_lost():
    before, other = panorama(), panorama()
    other = other._replace(grey=np.full_like(other.grey, 128))
    points = np.array([[100.0, 45.0]])
    assert not track(before.grey, other, points, points)[1].any()


def test_a_lost_point_is_found_again_by_its_intensities_and_another_is_not():
    image = panorama()
    strength = trackability(image)
    place = np.array([[120.0, 40.0]])
    for _ in range(5):  # uphill to a local maximum
        place = best_nearby(strength, image, place)
    seen = histograms(image, place)
    np.testing.assert_allclose(seen.sum(axis=1), 1.0, rtol=1e-6)
    found, there = find_again(image, strength, place + np.array([3.0, -2.0]), seen)
    assert there.all()
    np.testing.assert_allclose(found, place, atol=1.0)
    assert not find_again(image, strength, place, np.zeros_like(seen))[1].any()


@pytest.mark.parametrize(("column", "expected"), [(2, 357.0), (357, 2.0)])
def test_a_lost_point_is_found_again_across_the_edge_of_the_circle(column: int, expected: float):
    image = panorama()
    place = best_nearby(trackability(image), image, np.array([[120.0, 40.0]]))
    for _ in range(5):
        place = best_nearby(trackability(image), image, place)
    image = panorama(column - int(place[0, 0]))
    there = np.array([[float(column), place[0, 1]]])
    searched = np.array([[expected, place[0, 1]]])
    found, kept = find_again(image, trackability(image), searched, histograms(image, there))
    assert kept.all()
    np.testing.assert_allclose(found, there, atol=1.0)
