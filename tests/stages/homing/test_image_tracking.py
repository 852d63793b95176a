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
    left, right = 4.0 - SEAM, 355.0 + SEAM
    edges = [(left, 4.0), (right, 85.0), (left - 0.1, 9.0), (right + 0.1, 9.0), (9.0, 3.9), (9.0, 85.1), (np.nan, 9.0)]
    assert image.inside(np.array(edges), 4.0).tolist() == [True] * 2 + [False] * 5


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


@pytest.mark.parametrize("seam", [0, SEAM])
def test_a_point_is_chosen_and_described_by_the_pixels_around_it(seam: int):
    image = panorama()
    rows, columns = image.grey.shape[0], image.columns
    if not seam:
        image = image._replace(grey=np.ascontiguousarray(image.grey[:, SEAM:-SEAM]), seam=0)
    corner = np.random.default_rng(2).integers(0, 5, (40, 2)).astype(np.float64)
    points = np.concatenate([[[100.4, 50.0]], corner + 0.3, (columns - 1.0, rows - 1.0) - corner])
    strength = np.random.default_rng(1).random(image.grey.shape).astype(np.float32)
    best, looks = best_nearby(strength, image, points), histograms(image, points)
    for (x, y), chosen, look in zip(np.rint(points).astype(int).tolist(), best.tolist(), looks, strict=True):
        square = [(u, v) for v in range(y - 3, y + 4) for u in range(x - 3, x + 4)]
        inside = [(u, v) for u, v in square if 0 <= v < rows and -seam <= u < columns + seam]
        assert tuple(chosen) == max(inside, key=lambda at: strength[at[1], at[0] + seam])
        disc = [(x + u, y + v) for u in range(-5, 6) for v in range(-5, 6) if u * u + v * v <= 5.5**2]
        within = [(min(max(u, -seam), columns - 1 + seam), min(max(v, 0), rows - 1)) for u, v in disc]
        seen = [image.grey[v, u + seam] // 16 for u, v in within]
        assert look == pytest.approx(np.bincount(seen, minlength=16) / len(disc))


def test_points_are_followed_through_a_turn_also_across_the_edge():
    before, after = panorama(), panorama(6)
    strength = trackability(before)
    points = best_nearby(strength, before, np.array([[40.0, 45.0], [180.0, 30.0], [357.0, 50.0]]))
    found, kept = track(before.grey, after, points, points)
    assert kept.all()
    np.testing.assert_allclose(found[:, 1], points[:, 1], atol=0.1)
    np.testing.assert_allclose(found[:, 0], (points[:, 0] + 6.0) % 360, atol=0.1)


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
    for looks in (seen, histograms(image, place + 1.0)):  # it is sought among the best to track alone
        found, there = find_again(image, strength, place + np.array([3.0, -2.0]), looks)
        assert (found.tolist(), there.tolist()) == (place.tolist(), [True])
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
