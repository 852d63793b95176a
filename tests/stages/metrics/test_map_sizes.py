"""The size of maps, the density of views, and how far references lie from where they were taken."""

import dataclasses
import math

import numpy as np
import pytest
from made_values import with_few_landmarks
from measured_drives import AT_ORIGIN, figures, made_drive
from small_run import mixture_run, reference_graph, small_run

from omninav.pipeline import Context
from omninav.stages.metrics.map_pose_errors import MapPoseErrors
from omninav.stages.metrics.map_size import MapSize
from omninav.stages.metrics.view_map_size import ViewMapSize, visited_area
from omninav.stages.values.maps import ReferenceEvent
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import ViewMixtures


def test_a_map_of_references_is_as_large_as_its_arrays():
    ctx = Context("map")
    found = MapSize().step(ctx, reference_graph(40)).metrics.values["map"]
    size = 40 * 10 * 20 * 4 + 40 * 3 * 8 + 39 * 2 * 8  # 10 x 20 float32 and 3 float64 each, edges of 2 int64
    assert found == {
        "size_bytes": size,
        "references": 40,
        "edges": 39,
        "reference_size_bytes": size / 40,
        "pose_source": "truth",
    }
    assert ctx.facts["map_poses"] == "truth"
    assert figures(MapSize(), reference_graph(0))["map"]["reference_size_bytes"] is None


def test_a_map_is_as_large_as_its_landmarks_and_words_make_it():
    graph = with_few_landmarks()
    marks, words = graph.landmarks, graph.landmarks.words
    bare = figures(MapSize(), dataclasses.replace(graph, landmarks=None))["map"]["size_bytes"]
    more = (marks.points, marks.descriptors, marks.starts, marks.seen, marks.described, marks.mount, marks.pose_sigmas)
    more += (words.centres, words.rarity, words.starts, words.words, words.weights)
    expected = bare + sum(array.nbytes for array in more if array is not None)
    assert figures(MapSize(), graph)["map"]["size_bytes"] == expected


@pytest.fixture(scope="module")
def run():
    return small_run(frames=12)


@pytest.fixture(scope="module")
def views(run):
    return mixture_run(run)[0]


def test_a_map_of_views_is_as_large_as_its_arrays_and_as_dense_as_what_was_visited(run, views):
    found = figures(ViewMapSize(), run.drive, views)["map"]
    number, parts = len(views), len(views.weights)
    assert (number, parts) == (10, 11)
    assert found["size_bytes"] == number * (6 * 4 + 2 * 8) + parts * (8 + 3 * 8 + 9 * 8 + 8 + 8)
    assert (found["references"], found["components"]) == (number, parts)
    assert found["reference_size_bytes"] == found["size_bytes"] / number
    assert found["references_per_m2"] == pytest.approx(number / found["visited_area_m2"])


@pytest.mark.parametrize(("seen", "density"), [(None, None), (AT_ORIGIN, 0.0)])
def test_an_empty_map_has_no_size_of_a_reference_and_where_nothing_was_seen_no_density(seen, density):
    empty = figures(ViewMapSize(), made_drive([seen]), ViewMixtures.empty())["map"]
    assert (empty["reference_size_bytes"], empty["references_per_m2"]) == (None, density)
    assert (empty["visited_area_m2"] > 0.0) == (seen is not None)


def test_the_area_is_that_of_the_true_path_or_of_the_estimates_where_there_is_no_truth(run, views):
    true, blind = (figures(ViewMapSize(), each, views)["map"]["visited_area_m2"] for each in (run.drive, run.blind))
    assert true == visited_area(run.drive.truth[:, :2], 1.0)
    assert blind == visited_area(run.drive.estimate[:, :2], 1.0)
    assert true != blind


def test_the_visited_area_of_a_way_is_that_of_a_strip_with_round_ends():
    line = np.stack([np.linspace(0.0, 300.0, 4001), np.full(4001, 0.9)], axis=1)
    assert visited_area(line, 3.0) == pytest.approx(6.0 * 300.0 + math.pi * 3.0**2, rel=0.05)


def test_the_area_of_a_spot_is_that_of_the_cells_whose_middles_are_within_reach():
    # Cells of 1 m, and the spot as the middle of the eighth of a metre that it is in.
    for spot, middle in (((0.1, 0.3), (0.125, 0.375)), ((-0.6, 0.95), (-0.625, 0.875))):
        cells = [(x + 0.5, y + 0.5) for x in range(-6, 6) for y in range(-6, 6)]
        near = sum(math.dist(cell, middle) <= 2.0 for cell in cells)
        assert visited_area(np.array([spot]), 2.0) == near


SQUARE = [(0, 0), (2, 0), (2, 2), (0, 2)]


def learned(by_odometry, truths=SQUARE, source="odometry"):
    """Reference k comes in frame 2 k; its true pose is `truths[k]`."""
    map = dataclasses.replace(reference_graph(len(by_odometry)), pose_source=source)
    map.put(poses=np.array([(x, y, 0.0) for x, y in by_odometry], np.float64).reshape(-1, 3))
    events, truth = [], []
    for reference, spot in enumerate(truths[: len(by_odometry)]):
        events += [ReferenceEvent(reference, "far"), None]
        truth += [spot and Pose(float(spot[0]), float(spot[1]), 0.0), Pose(90.0, 90.0, 0.0)]
    return events, truth, map


def map_error(events, truth, map, straightened=None):
    found = figures(MapPoseErrors(), events, truth, map, straightened or map)
    return found and found["map_error"]


def test_references_are_measured_after_the_map_was_laid_over_the_truth():
    turned, wide = [(10 - y, 3 + x) for x, y in SQUARE], [(2 * x, 2 * y) for x, y in SQUARE]
    assert map_error(*learned(wide), learned(turned)[2]) == {
        "references": 4,
        "as_driven_m": pytest.approx(math.sqrt(2)),
        "straightened_m": pytest.approx(0.0, abs=1e-12),
    }


def test_an_error_is_the_root_mean_square():
    bent = [(0, 0), (2, 0), (4, 0), (6, 1)]
    angle = math.atan2(sum(y * (x - 3.0) for x, y in bent), sum((x - 3.0) ** 2 for x, _ in bent))
    cos, sin = math.cos(angle), math.sin(angle)
    left = [
        math.dist((cos * (x - 3.0) + sin * (y - 0.25), -sin * (x - 3.0) + cos * (y - 0.25)), (x - 3.0, 0.0))
        for x, y in bent
    ]
    found = map_error(*learned(bent, [(0, 0), (2, 0), (4, 0), (6, 0)]))
    assert found["as_driven_m"] == pytest.approx(math.sqrt(sum(error**2 for error in left) / 4))


def test_a_reference_without_a_true_pose_does_not_count_and_two_are_too_few():
    wrong = [*SQUARE[:3], (77, 77)]
    found = map_error(*learned(wrong, [*SQUARE[:3], None]))
    assert (found["references"], found["as_driven_m"]) == (3, pytest.approx(0.0, abs=1e-12))
    assert map_error(*learned(wrong, [*SQUARE[:2], None, None])) is None


def test_a_map_of_true_poses_or_of_none_is_not_measured():
    assert map_error(*learned(SQUARE, source="truth")) is None
    assert map_error(*learned([])) is None
