import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_mixtures import drawn_mixture
from made_view_maps import learned

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import density
from omninav.stages.sensor.superposition import Superposition
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold

CTX = Context("sensor")


def near(rows: list[int], alike: list[float], turns: list[float] | None = None) -> Neighbours:
    turned = np.zeros(len(rows)) if turns is None else np.array(turns)
    return Neighbours(np.array(rows, np.int64), 1 - np.array(alike), np.array(alike), turned, 0.0)


TWO = learned(0.0, 0.0, weights=0.8)
learned(0.0, 1.0, (5.0, 5.0, 1.0), weights=(0.5, 0.2), map=TWO)
learned(0.0, (9.0, 9.0, 2.0), weights=1.0, map=TWO)


def said(stage: Superposition, neighbours: Neighbours, map: ViewMixtures = TWO) -> GaussianMixture:
    found = stage.step(CTX, neighbours, map).hypothesis
    assert found is not None
    return found


def test_weights_are_likeness_times_weight_and_are_not_normalised() -> None:
    # Erratum 13: the weights of a view's places need not sum to 1, and stay so.
    found = said(Superposition(), near([1, 0], [0.9, 0.5]))
    assert found.weights == pytest.approx([0.5 * 0.8, 0.9 * 0.5, 0.9 * 0.2])
    assert found.means[:, 0].tolist() == [0.0, 1.0, 5.0]


def test_the_nearest_view_alone_is_the_crisp_mapping() -> None:
    found = said(Superposition(views="nearest"), near([1, 0], [0.9, 0.5]))
    assert found.means[:, 0].tolist() == [1.0, 5.0]


@given(st.floats(-math.pi, 3.14), st.floats(-math.pi, 3.14))
def test_headings_turn_by_what_was_taken_off_when_they_were_learned(heading: float, turn: float) -> None:
    # Erratum 12: stored as heading minus turn, used as stored plus turn; covariances as they are. Seam included.
    map = learned(0.0, (1.0, 2.0, float(wrap(heading - turn))), weights=1.0)
    found = said(Superposition(), near([0], [1.0], [turn]), map)
    assert abs(np.angle(np.exp(1j * (found.means[0, 2] - heading)))) < 1e-9
    assert -math.pi <= found.means[0, 2] < math.pi
    assert found.means[0, :2].tolist() == [1.0, 2.0]
    assert np.array_equal(found.covariances, map.covariances)


def test_places_without_weight_yet_say_nothing() -> None:
    map = learned(0.0, 1.0, 2.0, weights=(0.0, 0.3))
    assert said(Superposition(), near([0], [1.0]), map).means[:, 0].tolist() == [2.0]
    assert Superposition().step(CTX, near([0], [1.0]), learned(0.0, 1.0, weights=0.0)).hypothesis is None


def test_where_nothing_is_near_there_is_no_hypothesis() -> None:
    assert Superposition().step(CTX, None, TWO).hypothesis is None
    assert Superposition().step(CTX, near([], []), TWO).hypothesis is None
    assert Superposition().step(CTX, near([], []), ViewMixtures.empty()).hypothesis is None


def test_the_map_is_not_written_to() -> None:
    before = TWO.means.copy()
    said(Superposition(), near([0, 1, 2], [1.0, 1.0, 1.0], [1.0, 2.0, 3.0]))
    assert np.array_equal(TWO.means, before)


def test_it_is_the_sum_over_views_and_components_written_as_two_loops() -> None:
    rng = np.random.default_rng(0)
    means, covariances, weights = drawn_mixture(rng, 40)
    owners = rng.integers(0, 12, 40)
    map = ViewMixtures.empty()
    for _ in range(12):
        learned(0.0, map=map)
    for k in range(40):
        map.add_component(int(owners[k]), means[k], covariances[k], float(weights[k]), 1.0)
    rows, alike, turns = rng.permutation(12)[:7], np.sort(rng.random(7))[::-1], rng.uniform(-3, 3, 7)
    found = said(Superposition(), Neighbours(rows, 1 - alike, alike, turns, 0.0), map)
    points = drawn_mixture(rng, 50)[0]
    wanted = np.zeros(50)
    for j in range(7):
        for k in np.flatnonzero(owners == rows[j]):
            turned = means[k : k + 1] + np.array([0, 0, turns[j]])
            wanted += alike[j] * density(points, turned, covariances[k : k + 1], weights[k : k + 1])
    assert density(points, found.means, found.covariances, found.weights) == pytest.approx(wanted, rel=1e-9)


def test_a_view_with_an_extent_may_be_seen_from_around_where_it_was_learned() -> None:
    # At 0.25 and at half of the limit, of a drive whose views reach it after 2 m: 0.5 m and 1 m in x and in y.
    stage, limit = Superposition(extent=True), NoveltyThreshold(2.0, metres=2.0)
    neighbours = Neighbours(np.array([1, 0]), np.array([0.5, 1.0]), np.array([0.75, 0.5]), np.zeros(2), 0.5)
    wide, plain = stage.step(CTX, neighbours, TWO, limit).hypothesis, said(Superposition(), neighbours)
    assert wide is not None
    added = wide.covariances - plain.covariances
    assert added == pytest.approx(np.array([np.diag([way**2, way**2, 0.0]) for way in (1.0, 0.5, 0.5)]))
    np.testing.assert_array_equal(wide.means, plain.means)
    np.testing.assert_array_equal(wide.weights, plain.weights)


@pytest.mark.parametrize("limit", [None, NoveltyThreshold(2.0), NoveltyThreshold(0.0, metres=2.0)])
def test_without_a_measured_way_there_is_no_extent(limit: NoveltyThreshold | None) -> None:
    found = Superposition(extent=True).step(CTX, near([1], [0.9]), TWO, limit).hypothesis
    assert found is not None
    np.testing.assert_array_equal(found.covariances, said(Superposition(), near([1], [0.9])).covariances)
