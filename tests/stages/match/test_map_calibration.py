"""What similarities say of the place, learned on views that are left out in turn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_beliefs import along_x
from made_references import references

from omninav.pipeline import Context
from omninav.stages.geometry.probability.likelihood_ratio import standard_scores
from omninav.stages.match import map_calibration
from omninav.stages.match.map_calibration import calibrated, compared_with, right_and_wrong, spacing
from omninav.stages.match.retrieval import Retrieval
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose

HEADINGS, SEGMENTS = 8, 8


def a_walk(number: int = 80, step: float = 0.1) -> ReferenceGraph:
    """Views along a line, each segment's colours drifting with the place and all else random."""
    rng = np.random.default_rng(2)
    far = np.arange(number) * step
    phases, rates = rng.uniform(0, 2 * np.pi, (SEGMENTS, 12)), rng.uniform(0.5, 2.0, (SEGMENTS, 12))
    values = (1.05 + np.cos(far[:, None, None] * rates + phases)).astype(np.float32) ** 4
    values /= values.sum(axis=-1, keepdims=True)
    return references(along_x(*far).means, values)


def test_right_cells_are_near_and_of_the_nearest_heading_and_wrong_ones_well_away():
    references = np.array([[0.1, 0, 0], [0.2, 0, math.pi / 2], [0.51, 0, 0], [1.5, 0, 0], [1.51, 0, 0]])
    right, wrong = right_and_wrong(np.array([0.0, 0.0, 0.3]), references, HEADINGS, 0.5)
    # Turned by 0.3 - pi / 2, which is -1.6 of 8 steps: the sixth.
    assert np.argwhere(right).tolist() == [[0, 0], [1, 6]]
    assert wrong.any(axis=1).tolist() == [False, False, False, False, True]
    turns = np.radians([29.5, 30.5, -59.5, -60.5])  # of views of one heading: right within 30, wrong beyond 60 degrees
    right, wrong = right_and_wrong(np.zeros(3), np.column_stack([[0.5, 0, 0, 0], 0 * turns, turns]), 1, 0.5)
    assert right[:, 0].tolist() == [True, False, False, False]
    assert wrong[:, 0].tolist() == [False, False, False, True]


def test_a_large_map_is_sampled_and_the_sample_stands_for_all():
    chosen, each = compared_with(along_x(*range(5000)).means, 2500, 10.0)
    assert 2500 not in chosen
    assert (np.diff(chosen) > 0).all()
    assert set(range(2490, 2500)) <= set(chosen.tolist())
    assert len(chosen) == 1000 + 20
    assert each.sum() == pytest.approx(4999)


def test_a_sample_is_all_that_is_near_and_an_even_choice_of_what_is_far(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.match.map_calibration.MAX_COMPARED", 3)
    chosen, each = compared_with(along_x(*range(10)).means, 5, 1.0)
    assert chosen.tolist() == [0, 3, 4, 6, 9]  # of 0, 1, 2, 3, 7, 8, 9 the first, the middle, and the last
    assert each == pytest.approx([7 / 3, 7 / 3, 1.0, 1.0, 7 / 3])
    chosen, each = compared_with(along_x(*range(4)).means, 1, 1.0)
    assert (chosen.tolist(), each.tolist()) == ([0, 2, 3], [1.0] * 3)


def test_the_spacing_of_a_map_is_the_median_way_to_the_next_place():
    assert spacing(along_x(0.0, 1.0, 3.0, 3.0, 7.0, 7.0).means) == 1.5  # 1, 1, 2 and 4 m
    assert [spacing(along_x(2.0, x).means) for x in (2.0, 5.0)] == [0.0, 3.0]


@pytest.mark.parametrize("match", [SelectiveMatch(headings=HEADINGS), Retrieval(headings=HEADINGS)])
def test_a_match_calibrates_its_map_once_and_the_same_each_time(match: SelectiveMatch | Retrieval):
    walk, view = a_walk(), SegmentHistograms(a_walk().features[7])
    ctx = Context("match")
    first = match.step(ctx, view, walk, length_scale=LengthScale(0.3)).calibration
    assert first is not None
    assert match.step(ctx, view, walk, length_scale=LengthScale(0.3)).calibration is first
    again = replace(match).step(Context("match"), view, a_walk(), length_scale=LengthScale(0.3)).calibration
    assert again is not None
    assert vars(again) == vars(first)
    assert ctx.facts["similarity_calibration"]["images"] == 80
    assert first.slope > 1.0
    assert first.right_distance_m == pytest.approx(0.3)
    walk.insert(Pose(8.0, 0.0, 0.0), walk.features[0], "histograms")
    grown = match.step(ctx, view, walk).calibration  # without a length scale, one and a half of its spacings of 0.1 m
    assert (grown.images, grown.right_distance_m) == (81, pytest.approx(0.15))


@pytest.mark.parametrize("headings", [1, HEADINGS])
def test_each_image_counts_the_same_and_views_of_one_heading_correlate_where_they_look_alike(
    headings: int, monkeypatch: pytest.MonkeyPatch
):
    given: list[tuple] = []
    monkeypatch.setattr(map_calibration, "logistic_fit", lambda *all: given.append(all) or (2.0, 3.0))
    monkeypatch.setattr(map_calibration, "correlation_length", lambda *all: given.append(all))
    poses = np.column_stack([np.arange(12) * 0.2, np.zeros(12), np.radians([0, 20, 29, 50, 31, 5] * 2)])
    likeness = np.random.default_rng(0).uniform(0.1, 1, (12, 12, headings)).astype(np.float32)
    found = calibrated(references(poses), lambda view, chosen: likeness[view, chosen], 0.3)
    (scores, weights, right), (evidence, places, alike) = given
    assert vars(found) == vars(SimilarityCalibration(2.0, 3.0, 12, 0.3, 0.3))
    assert weights[right].sum() == pytest.approx(12)
    assert weights[~right].sum() == pytest.approx(12)
    others = np.delete(np.arange(12), 4)
    each = standard_scores(likeness[4, others])
    cells = right_and_wrong(poses[4], poses[others], headings, 0.3)[0]
    assert evidence[4] == pytest.approx(each[cells].mean(), abs=1e-6)
    assert set(each[cells].tolist()) <= set(scores[right].tolist())
    assert np.array_equal(places, poses[:, :2])
    gaps = np.abs(np.degrees(poses[:, None, 2] - poses[:, 2]))
    assert alike is None if headings > 1 else np.array_equal(alike, gaps <= 30.0)


@pytest.mark.parametrize("segments", [1, SEGMENTS])
def test_a_map_s_own_views_are_retrieved_at_one_heading_where_they_are_single_pictures(
    segments: int, monkeypatch: pytest.MonkeyPatch
):
    given: list = []
    monkeypatch.setattr(map_calibration, "calibrated", lambda map, compare, length: given.append(compare))
    full = a_walk()
    map = references(full.poses, full.features[:, :segments])
    for directions in (None, np.zeros(1))[: 2 if segments == 1 else 1]:
        out = Retrieval(headings=HEADINGS).step(Context("match"), SegmentHistograms(map.features[7], directions), map)
        seen = given.pop()(7, np.array([3, 9]))
        assert seen.shape == (2, 1 if segments == 1 else HEADINGS)
        assert seen == pytest.approx(out.similarities.values[[3, 9]], abs=1e-6)


def test_nothing_is_compared_where_nobody_reads_the_calibration():
    ctx = Context("match")
    ctx.read = frozenset({"similarities"})
    walk = a_walk()
    assert SelectiveMatch(headings=HEADINGS).step(ctx, SegmentHistograms(walk.features[0]), walk).calibration is None
    assert not ctx.facts


def test_a_map_that_is_too_small_or_all_of_one_place_has_none():
    def never(view: int, chosen: np.ndarray) -> np.ndarray:
        return np.full((len(chosen), HEADINGS), 0.5, np.float32)

    assert calibrated(a_walk(9), never, 0.0) is None
    assert calibrated(a_walk(10), never, 0.0).images == 10
    assert calibrated(a_walk(40, step=0.001), never, 0.3) is None


def test_a_left_out_view_is_not_compared_with_itself():
    asked: list[tuple[int, list[int]]] = []

    def compare(view: int, chosen: np.ndarray) -> np.ndarray:
        asked.append((view, chosen.tolist()))
        return np.random.default_rng(view).uniform(0.1, 1, (len(chosen), HEADINGS)).astype(np.float32)

    found = calibrated(a_walk(300), compare, 0.3)
    assert [view for view, _ in asked] == np.linspace(0, 299, 200).astype(int).tolist()
    assert all(view not in chosen and len(chosen) == 299 for view, chosen in asked)
    assert found is not None
    assert found.slope < 0.5  # similarities at random say nothing
