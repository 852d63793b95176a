"""Views, as one vector each or by their local features, and drives of them."""

import math

import numpy as np
import pytest

from omninav.pipeline.graph.contents import violation
from omninav.stages.values.features import SegmentDescriptors
from omninav.stages.values.image import Panorama, column_azimuths
from omninav.stages.values.local_features import LocalFeatures, VerticalSegments, view_features
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.thumbnails import Thumbnails, encoded
from omninav.stages.values.views import Coefficients, Spectrum


def test_columns_of_a_panorama_run_clockwise_from_behind_and_its_edges_are_at_most_upright() -> None:
    assert np.degrees(column_azimuths(4)) == pytest.approx([135.0, 45.0, -45.0, -135.0])
    pixels = np.zeros((2, 4, 3), np.uint8)
    assert violation(Panorama(pixels, math.pi / 2, -math.pi / 2)) is None
    assert violation(Panorama(pixels, 1.6, 0.0)) is not None
    assert violation(Panorama(pixels, 0.0, -1.6)) is not None


def test_vectors_of_segments_are_brought_to_length_1_each() -> None:
    values = SegmentDescriptors.of(np.array([[3.0, 4.0], [0.0, 0.0], [0.0, -0.5]])).values
    assert values == pytest.approx(np.array([[0.6, 0.8], [0.0, 0.0], [0.0, -1.0]]))
    assert values.dtype == np.float32


def test_points_are_those_of_patches_and_then_both_ends_of_each_column() -> None:
    bearings = np.array([[0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [-1.0, 0.0, 0.0]])
    points = np.arange(6.0).reshape(3, 2)
    looks, colours = np.arange(12, dtype=np.uint8).reshape(3, 4), np.zeros((3, 3), np.float32)
    patches = LocalFeatures(bearings, points, looks, colours, np.arange(3.0, dtype=np.float32))
    assert patches.point_bearings() is bearings
    assert patches.point_pixels() is points
    assert view_features(patches).segments is None
    columns = VerticalSegments(
        np.radians([90.0, 30.0]),
        np.radians([[30.0, -60.0], [0.0, -90.0]]),
        np.arange(20, dtype=np.float32).reshape(2, 10),
        np.array([1.0, 2.0], np.float32),
        np.arange(10.0, 18.0).reshape(2, 2, 2),
    )
    both = LocalFeatures(bearings, points, looks, colours, patches.sizes, columns)
    assert violation(both) is None
    root = math.sqrt(0.75)
    ends = [[0.0, root, 0.5], [0.0, 0.5, -root], [root, 0.5, 0.0], [0.0, 0.0, -1.0]]
    assert both.point_bearings() == pytest.approx(np.concatenate([bearings, ends]))
    assert both.point_pixels().tolist() == [*points.tolist(), *np.arange(10.0, 18.0).reshape(4, 2).tolist()]
    view = view_features(both)
    assert view.patches.azimuths == pytest.approx([math.pi / 2, 0.0, math.pi])
    assert view.patches.descriptors.tolist() == looks.tolist()
    assert (view.segments[0] is columns.descriptors, view.segments[1] is columns.azimuths) == (True, True)
    some, one = both.chosen(np.array([2, 0])), columns.chosen(np.array([1]))
    assert (some.bearings.tolist(), some.sizes.tolist()) == (bearings[[2, 0]].tolist(), [2.0, 0.0])
    assert (some.points.tolist(), some.descriptors.tolist()) == (points[[2, 0]].tolist(), looks[[2, 0]].tolist())
    assert (len(one), one.weights.tolist(), one.points.tolist()) == (1, [2.0], columns.points[1:].tolist())
    assert (one.elevations.tolist(), one.azimuths.tolist()) == (columns.elevations[1:].tolist(), [columns.azimuths[1]])


def test_views_of_both_kinds_know_how_far_they_are_from_kept_ones_and_how_turned() -> None:
    turned = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]], np.float32)
    view = Coefficients(turned[0], turned)
    assert view.distances(turned[[1, 0]] * 2) == pytest.approx([1.0, 1.0])
    assert np.mod(view.turns(turned[[0, 2]]), 2 * math.pi) == pytest.approx([0.0, math.pi])
    again = view.like(2 * view.rows)
    assert (again.values.tolist(), again.rows.tolist()) == ([2.0, 0.0], (2 * turned).tolist())
    grey = np.random.default_rng(0).random((2, 8))
    spectra = [np.fft.rfft(np.roll(grey, shift, axis=1), axis=1)[:, :4].ravel() for shift in (0, 3)]
    one, other = (np.concatenate([each.real, each.imag]).astype(np.float32) for each in spectra)
    spectrum = Spectrum(one, 2, 8)
    assert spectrum.rows.tolist() == [one.tolist()]
    assert spectrum.like(other[None]).values is not one
    assert spectrum.distances(np.stack([one, other, 2 * one]))[:2] == pytest.approx([0.0, 0.0], abs=1e-5)
    assert abs(spectrum.turns(other[None])[0]) == pytest.approx(3 / 8 * 2 * math.pi, abs=1e-3)


def test_drives_keep_their_views_the_ways_between_them_and_what_was_believed() -> None:
    def view(number: float) -> Coefficients:
        return Coefficients(np.full(2, number, np.float32), np.array([[number, number], [number, 9.0]], np.float32))

    drives = Sessions.empty(view(0.0))
    assert (len(drives), drives.by_odometry.shape, drives.views.shape) == (0, (0, 3), (0, 2, 2))
    quarter = np.array([3.0, 4.0, math.pi / 2])
    for number, begins in enumerate((True, False, False, True, False)):
        drives.move(quarter)
        drives.keep(view(float(number)), np.array([1.0, 2.0, 3.0]) if number == 1 else None, begins, 10 + number)
    assert violation(drives) is None
    drives.move(quarter)
    drives.move(quarter)
    assert len(drives) == 5
    assert drives.values[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert drives.view(3).rows.tolist() == view(3.0).rows.tolist()
    assert drives.drives.tolist() == [0, 0, 0, 1, 1]
    assert drives.driven.tolist() == [0.0, 5.0, 10.0, 10.0, 15.0]
    turns = [0.0, math.pi / 2, math.pi, 0.0, math.pi / 2]
    places = [[0.0, 0.0], [3.0, 4.0], [-1.0, 7.0], [0.0, 0.0], [3.0, 4.0]]
    assert drives.by_odometry[:, :2] == pytest.approx(np.array(places))
    assert np.mod(drives.by_odometry[:, 2], 2 * math.pi) == pytest.approx(turns)
    assert drives.since[:2] == pytest.approx([-1.0, 7.0])
    assert (drives.sure.tolist(), drives.believed[1].tolist()) == ([False, True, False, False, False], [1.0, 2.0, 3.0])
    assert (drives.ticks.tolist(), drives.begins.tolist()) == ([10, 11, 12, 13, 14], [True, False, False, True, False])
    assert not drives.believed[[0, 2, 3, 4]].any()


def test_a_reference_s_best_heading_is_the_first_of_equal_ones() -> None:
    values = np.array([[0.2, 0.8, 0.8], [0.5, 0.1, 0.4], [0.1, 0.2, 0.3]], np.float32)
    found = Similarities(values, sampling_weight=np.array([1.0, 2.0, 1.0]))
    assert found.best.tolist() == values[[0, 1, 2], [1, 0, 2]].tolist()
    assert found.best_heading.tolist() == [1, 0, 2]
    assert found.spread == pytest.approx(np.std([0.8, 0.5, 0.5, 0.3]), rel=1e-5)


def test_each_reference_has_its_own_thumbnail() -> None:
    pictures = [np.full((8, 12, 3), grey, np.uint8) for grey in (40, 200)]
    jpegs = [encoded(picture) for picture in pictures]
    kept = Thumbnails(np.frombuffer(b"".join(jpegs), np.uint8), np.cumsum([0, *map(len, jpegs)]))
    assert len(kept) == 2
    for number, picture in enumerate(pictures):
        assert kept.image(number).shape == picture.shape
        assert np.abs(kept.image(number).astype(int) - picture).max() < 4
