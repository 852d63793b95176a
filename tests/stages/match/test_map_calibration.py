"""What similarities say of the place, learned on views that are left out in turn."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_beliefs import along_x
from made_references import references

from omninav.pipeline import Context
from omninav.stages.match.map_calibration import calibrated, compared_with, right_and_wrong, spacing
from omninav.stages.match.retrieval import Retrieval
from omninav.stages.match.selective import SelectiveMatch
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
    references = np.array([[0.1, 0, 0], [0.2, 0, math.pi / 2], [0.51, 0, 0], [1.51, 0, 0]])
    right, wrong = right_and_wrong(np.array([0.0, 0.0, 0.3]), references, HEADINGS, 0.5)
    # Turned by 0.3 - pi / 2, which is -1.6 of 8 steps: the sixth.
    assert np.argwhere(right).tolist() == [[0, 0], [1, 6]]
    assert wrong.any(axis=1).tolist() == [False, False, False, True]
    turns = np.radians([29.0, 31.0, -59.0, -61.0])  # of views of one heading: right within 30, wrong beyond 60 degrees
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
    assert spacing(along_x(2.0, 2.0).means) == 0.0


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
