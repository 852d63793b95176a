"""Poses proposed where the current view fits."""

import numpy as np
import pytest
from made_references import references

from omninav.pipeline import Context
from omninav.stages.sensor.near_references import similarity_field
from omninav.stages.sensor.similarity_proposals import SimilarityProposals, _search, _steps, draw_cells
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.track import Track

RNG = np.random.default_rng(0)
REFERENCES = np.column_stack([RNG.uniform(0, 4, (40, 2)), RNG.uniform(-3, 3, 40)])
MAP = references(REFERENCES)


def test_cells_are_drawn_by_weight_and_sampling_weight() -> None:
    field = np.full((3, 4), 0.1, np.float32)
    field[0, 1] = field[2, 3] = 1.0
    each = np.array([1.0, 5.0, 3.0])
    weighted = similarity_field(Similarities(field, sampling_weight=each), 0.5, 1.0, 2.0)
    drawn, drawn_weights = draw_cells(weighted, np.random.default_rng(0), 40_000)
    # By hand: each cell weighs its value, or the floor, squared, as often as its reference counts.
    weights = (np.maximum(field, 0.5) ** 2 * each[:, None]).ravel()
    shares = np.bincount(drawn, drawn_weights, minlength=12)
    assert shares == pytest.approx(weights / weights.sum(), abs=0.01)
    assert shares[1] == pytest.approx(1 / 12, abs=0.004)
    # Half of the draws are by what is above the floor: 0.75 at one cell, three times as much at the other.
    assert np.bincount(drawn, minlength=12)[1] / 40_000 == pytest.approx(0.5 / 12 + 0.5 / 4, abs=0.01)


def test_a_running_sum_is_searched_and_taken_apart_again() -> None:
    running = np.array([1.0, 3.0, 3.0, 7.0])
    assert _steps(running, np.array([3, 0, 1, 2, 1])).tolist() == [4.0, 1.0, 2.0, 0.0, 2.0]
    assert _search(running, np.array([0.0, 0.9, 1.0, 2.9, 3.0, 6.9, 7.0])).tolist() == [0, 0, 1, 1, 3, 3, 3]


@pytest.mark.parametrize("floor", [0.0, 2.0])
def test_where_all_or_nothing_rises_above_the_floor_cells_are_drawn_by_weight_too(floor: float) -> None:
    field = np.array([[0.2, 0.4], [0.8, 0.6]], np.float32)
    similarities = similarity_field(Similarities(field), floor, 1.0, 1.0)
    drawn, drawn_weights = draw_cells(similarities, np.random.default_rng(0), 40_000)
    weights = np.maximum(field, floor).ravel()
    assert np.bincount(drawn, drawn_weights, minlength=4) == pytest.approx(weights / weights.sum(), abs=0.01)


@pytest.mark.parametrize("candidates", [None, np.arange(2, 20)], ids=["all compared", "some compared"])
def test_poses_are_drawn_around_the_best_reference_and_heading(
    monkeypatch: pytest.MonkeyPatch, candidates: np.ndarray | None
) -> None:
    values = np.full((40, 36), 0.5, np.float32)
    values[3, 9] = 0.9  # at reference 3, for a robot turned left by a quarter
    similarities = Similarities(values if candidates is None else values[candidates], candidates)
    ctx = Context("proposals", np.random.default_rng(0))
    field = similarity_field(similarities, 0.5, 0.9, 30.0)
    monkeypatch.setattr("omninav.stages.sensor.similarity_proposals.NUMBER", 20_000)
    proposals = SimilarityProposals().step(ctx, field, MAP, LengthScale(0.5), Track(False, False)).proposals
    assert proposals is not None
    assert proposals.weights.sum() == pytest.approx(1.0)
    away = proposals.poses[proposals.weights > 1e-5] - REFERENCES[3] - [0.0, 0.0, np.pi / 2]
    assert len(away) > 19_900  # the others are from the floor, and weigh next to nothing
    assert away[:, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.01)
    assert np.cov(away[:, :2].T) == pytest.approx(np.eye(2) * 0.2**2, abs=0.001)  # 0.4 x 0.5 m
    turns = np.sort(np.angle(np.exp(1j * away[:, 2])))  # evenly over a step between two headings
    assert turns == pytest.approx(((np.arange(len(away)) + 0.5) / len(away) - 0.5) * np.pi / 18, abs=0.003)
    assert np.abs(proposals.poses[:, 2]).max() <= np.pi


def test_without_a_field_and_while_the_track_is_unbroken_there_are_no_proposals() -> None:
    field = similarity_field(Similarities(np.ones((40, 4), np.float32)), 0.0, 1.0, 1.0)
    assert SimilarityProposals().step(Context("proposals"), None, MAP).proposals is None
    assert SimilarityProposals().step(Context("proposals"), field, MAP, None, Track(True, False)).proposals is None
