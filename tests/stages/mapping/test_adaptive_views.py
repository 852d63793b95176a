"""The map of views of Gross, Koenig & Mueller 2005, section 2.3: its equations by hand, and what always holds."""

import math

import numpy as np
import pytest
from made_view_maps import learned, view

from omninav.pipeline import Context
from omninav.stages.geometry.appearance.spectra import packed
from omninav.stages.mapping.adaptive_views import AdaptiveViews
from omninav.stages.mapping.view_updates import PendingUpdates
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, Spectrum

FORGET_GAIN = "omninav.stages.mapping.adaptive_views.FORGET_GAIN"
LIMIT = NoveltyThreshold(1.0)
FREE = {"min_sigma_m": 0.0, "min_sigma_deg": 0.0}


def state(*means, sigma=0.1, weights=None):
    means = np.array(means, np.float64)
    covariances = np.stack([np.eye(3) * sigma**2] * len(means))
    return GaussianMixture(means, covariances, np.full(len(means), 1.0) if weights is None else np.array(weights))


def learn(map, view, state, threshold=LIMIT, **options):
    stage = AdaptiveViews(**{**FREE, **options})
    updates = MapUpdates((MapUpdate(view, state, 0),))
    return stage.step(Context("mapping"), updates, threshold, map, PendingUpdates()).events


def test_a_new_view_is_inserted_with_its_state_and_weight_beta():
    map = ViewMixtures.empty()
    event = learn(map, view(0, 0), state([1, 2, 0.5]))
    assert event.inserted.tolist() == [0]
    # S = 1 to itself: eta = 1 / 1 (11), w = beta * 1 + (1 - beta) * 0 (16).
    assert map.counts.tolist() == [1.0]
    assert map.weights.tolist() == [0.1]
    np.testing.assert_allclose(map.means, [[1, 2, 0.5]])
    event = learn(map, view(1.0, 0), state([5, 2, 0.5]))
    assert event.inserted.tolist() == [1], "a distance at the limit is a new view's"


def test_one_observation_is_shared_among_the_similar_views():
    map = ViewMixtures.empty()
    learn(map, view(0, 0), state([0, 0, 0]))
    learn(map, view(1.1, 0), state([4, 0, 0]))
    # S to the two: 1 - 0.4 = 0.6 and 1 - 0.7 = 0.3; eta 2 / 3 and 1 / 3 (equation 11, erratum 6).
    learn(map, view(0.4, 0), state([9, 0, 0]))
    assert map.counts[map.means[:, 0] == 9].tolist() == pytest.approx([2 / 3, 1 / 3])


def test_merged_places_are_the_counts_mean_and_not_their_sum():
    map = learned(0.0, (10.0, 5.0, 0.0), sigma=2.0, count=5.0)
    # Erratum 7: eta 5 and 0.4 must not move (10, 5) to (54, 27). Here eta 5 and 1 at (10, 5) and (13, 5).
    learn(map, view(0, 0), state([13, 5, 0], sigma=2.0), state_covariance="every_update")
    assert len(map.weights) == 1
    np.testing.assert_allclose(map.means[0], [10 + 3 / 6, 5, 0])
    # Equation 14: (5 (4 + 0.5^2) + 1 (4 + 2.5^2)) / 6 along x, 4 along y.
    np.testing.assert_allclose(np.diag(map.covariances[0]), [(5 * 4.25 + 10.25) / 6, 4, 4])
    assert map.counts.tolist() == [6.0]
    assert map.weights.tolist() == [0.1 + 0.9 * 0.5]


def test_a_confirmed_component_adds_the_spread_of_the_means_and_not_the_covariance_again():
    map = learned(0.0, (10.0, 5.0, 0.0), sigma=2.0, count=5.0)
    learn(map, view(0, 0), state([13, 5, 0], sigma=2.0), min_sigma_m=0.1)
    # As above, but what comes has 0.1 m instead of 2 m: (5 (4 + 0.5^2) + 1 (0.1^2 + 2.5^2)) / 6 along x.
    np.testing.assert_allclose(np.diag(map.covariances[0]), [(5 * 4.25 + 6.26) / 6, 20.01 / 6, 20 / 6])
    learn(map, view(0, 0), state([30, 5, 0], sigma=2.0), min_sigma_m=0.1)
    new = map.means[:, 0] == 30
    np.testing.assert_allclose(np.diag(map.covariances[new][0]), 4.0, err_msg="elsewhere it is a place of its own")


def turned(steps):
    """A view from a robot that has turned counter-clockwise: what was ahead is now further on in the panorama."""
    signal = np.random.default_rng(0).normal(size=(1, 36))
    spectrum = np.fft.rfft(np.roll(signal, steps, axis=1), axis=1)[:, :10] / 6.0
    return Spectrum(packed(spectrum), 1, 36)


def test_a_place_that_is_seen_with_another_heading_is_confirmed_by_each_of_two_modes():
    map = ViewMixtures.empty()
    both = {"sigma": 0.1, "weights": [0.5, 0.5]}
    heading = 3.0 + 7 * 2 * math.pi / 36 - 2 * math.pi
    learn(map, turned(0), state([0, 0, 3.0], [9, 0, 3.0], **both))
    learn(map, turned(7), state([0, 0, heading], [9, 0, heading], **both))
    assert map.means[:, 2] == pytest.approx([3.0] * 2, abs=0.01)
    assert map.counts.tolist() == [1.0] * 2
    # w = beta S / 2 + (1 - beta S) * beta / 2, with S = 1 and beta = 0.1 (passive).
    assert map.weights.tolist() == pytest.approx([0.05 + 0.9 * 0.05] * 2, abs=1e-3)


def test_places_that_fit_grow_and_the_others_of_the_same_view_fade():
    map = learned(0.0, 0.0, 8.0)
    event = learn(map, view(0.2, 0), state([0, 0, 0]), forgetting="passive")
    # S = 0.8: w = 0.08 + 0.92 * 0.5 (16), and 0.92 * 0.5 (17).
    np.testing.assert_allclose(map.weights[np.argsort(map.means[:, 0])], [0.54, 0.46])
    assert event.changed.tolist() == [0]
    learn(map, view(0.2, 0), state([0, 0, 0]), forgetting="none")
    np.testing.assert_allclose(map.weights[np.argsort(map.means[:, 0])], [0.08 + 0.92 * 0.54, 0.46])


@pytest.mark.parametrize(
    ("forgetting", "sigma", "kept"),
    [("active", 0.1, [0.9, 0.975, 1.0]), ("active", 0.2, [0.95, 0.9875, 1.0]), ("passive", 0.2, [1.0, 1.0, 1.0])],
)
def test_a_dissimilar_view_seen_here_is_forgotten_by_distance_and_uncertainty(monkeypatch, forgetting, sigma, kept):
    # b = 0.2 (1 - d / 0.4) 0.1 / (0.1 + 0.1): 0.1 at 0 m, 0.025 at 0.3 m, nothing at 0.6 m; headings do not matter.
    monkeypatch.setattr(FORGET_GAIN, 0.25)
    map = ViewMixtures.empty()
    for look, x in ((10.0, 0.0), (12.0, 0.3), (14.0, 0.6)):
        learned(look, (x, 0.0, 2.0), map=map)
    learn(map, view(0, 0), state([0, 0, 0], sigma=sigma), NoveltyThreshold(1.0, True, 0.4), forgetting=forgetting)
    np.testing.assert_allclose(map.weights[:3], 0.5 * np.array(kept))


def test_a_very_certain_state_removes_at_most_the_whole_weight(monkeypatch):
    monkeypatch.setattr(FORGET_GAIN, 2.0 / 0.3)
    map = learned(10.0, 0.0)
    # b = 0.2 * 2 / 0.002 = 200: without a limit the weight would be negative (erratum 11).
    event = learn(map, view(0, 0), state([0, 0, 0], sigma=0.001), forgetting="active")
    assert event.removed.tolist() == [0]
    assert event.why == "forgotten"
    assert map.ids.tolist() == [1]


def test_a_new_component_survives_its_first_tick_at_any_similarity():
    map = ViewMixtures.empty()
    learn(map, view(0, 0), state([0, 0, 0]))
    learn(map, view(0.79, 0), state([9, 0, 0]))
    assert 9 in map.means[:, 0].round(9), "S = 0.21: taken in, w = 0.021"
    learn(map, view(0.81, 0), state([20, 0, 0]))
    assert 20 not in map.means[:, 0].round(9), "S = 0.19 is not enough"


def test_a_place_never_seen_again_loses_its_weight_and_a_view_without_places_goes():
    map = ViewMixtures.empty()
    learn(map, view(0, 0), state([0, 0, 0]))
    steps = 0
    while 0.0 in map.means[:, 0].round(9):
        learn(map, view(0, 0), state([9, 0, 0]), forgetting="passive")
        steps += 1
    # 0.1 * 0.9^n < 0.01 from n = 22.
    assert steps == 22


def test_the_cap_on_views_holds_when_many_updates_come_at_once():
    map = ViewMixtures.empty()
    updates = MapUpdates(tuple(MapUpdate(view(2 * n, 0), state([n, 0, 0]), n) for n in range(9)))
    stage = AdaptiveViews(max_views=4)
    event = stage.step(Context("mapping"), updates, LIMIT, map, PendingUpdates()).events
    assert len(map) == event.views == 4
    assert 8 in map.ids
    assert event.inserted.tolist() == map.ids.tolist()


def test_the_length_scale_of_forgetting_is_that_of_a_settled_threshold():
    # b = 0.2 (1 - d / s) 2 s / (0.1 + 0.1), at most 1: at (0.24, 0.32), 0.4 m away, with s = 0.5 m 0.2, with 0.3 m
    # (unknown) nothing.
    for threshold, weight in (
        (NoveltyThreshold(1.0, True, 0.5), 0.4),
        (NoveltyThreshold(1.0, False, 0.5), 0.5),
        (NoveltyThreshold(1.0, True, 0.0), 0.5),
    ):
        map = learned(10.0, (0.24, 0.32, 0.0))
        learn(map, view(0, 0), state([0, 0, 0]), threshold)
        assert map.weights[0] == pytest.approx(weight)
        assert map.threshold == (threshold if threshold.settled else None)


def test_forgetting_goes_by_both_sigmas_of_each_mode_and_its_weight(monkeypatch):
    monkeypatch.setattr(FORGET_GAIN, 0.4 / 0.3)
    # b = 0.2 * 0.4 / (0.1 + 0.3) = 0.2 of a mode of half the weight.
    map = learned(10.0, 0.0)
    covariances = np.stack([np.diag([0.01, 0.09, 0.01])] * 2)
    split = GaussianMixture(np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]), covariances, np.array([3.0, 3.0]))
    learn(map, view(0, 0), split)
    assert map.weights[0] == pytest.approx(0.5 * (1.0 - 0.5 * 0.2))
    assert map.weights[1:] == pytest.approx([0.05, 0.05])


def test_a_component_at_the_limit_still_fits_and_headings_count(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.mapping.adaptive_views.MERGE_BELOW", 0.0)
    # Squared distances with both covariances: 0.4^2 / 0.02 = 8; and 3.0 against -3.0 rad is 0.283 rad apart: 4.01.
    for where, fits, grows in (([0.4, 0, 3.0], 8.0, True), ([0.4, 0, 3.0], 7.9, False), ([0, 0, -3.0], 4.1, True)):
        map = learned(0.0, (0.0, 0.0, 3.0))
        monkeypatch.setattr("omninav.stages.mapping.adaptive_views.FITS_BELOW", fits + 1e-9)
        learn(map, view(0, 0), state(where))
        assert map.weights[0] == pytest.approx(0.1 + 0.9 * 0.5 if grows else 0.9 * 0.5)


def test_weights_of_merged_components_are_added_and_capped_at_one():
    # Erratum 8: 0.7 and 0.6 become 1, which the state then confirms: 0.1 + 0.9 * 1.
    map = learned(0.0, 0.0, 0.1, weights=(0.7, 0.6), count=2.0)
    learn(map, view(0, 0), state([0.05, 0, 0]))
    assert map.weights == pytest.approx([1.0])
    assert map.counts == pytest.approx([5.0])
    assert map.means[0] == pytest.approx([0.05, 0.0, 0.0])


def test_each_mode_confirms_the_component_that_is_nearest_to_it_and_a_far_one_is_new():
    map = learned(0.0, 0.0, 0.5, 5.0)
    modes = state([9.0, 0, 0], [0.4, 0, 0], [5.1, 0, 0], sigma=0.2, weights=[0.25, 0.5, 0.25])
    learn(map, view(0, 0), modes, min_sigma_m=0.1, min_sigma_deg=np.degrees(0.1))
    order = np.argsort(map.means[:, 0])
    # Counts 3 and 0.5 or 0.25: (3 * 0.5 + 0.5 * 0.4) / 3.5 and (3 * 5 + 0.25 * 5.1) / 3.25.
    assert map.means[order, 0] == pytest.approx([0.0, 1.7 / 3.5, 16.275 / 3.25, 9.0])
    assert map.counts[order] == pytest.approx([3.0, 3.5, 3.25, 0.25])
    # The mode at 0.4 m fits both of the first: 0.4^2 / 0.05 is 3.2.
    assert map.weights[order] == pytest.approx([0.1 * 0.5 + 0.45, 0.1 * 0.5 + 0.45, 0.1 * 0.25 + 0.45, 0.1 * 0.25])
    apart = 3.0 * 0.5 / 3.5**2 * 0.1**2
    assert np.diag(map.covariances[order[1]]) == pytest.approx([0.01 + apart, 0.01, 0.01])
    assert np.diag(map.covariances[order[3]]) == pytest.approx([0.04, 0.04, 0.04])


def test_only_modes_that_are_similar_and_heavy_enough_are_learned(monkeypatch: pytest.MonkeyPatch):
    # S = 0.5: of modes 0.6 and 0.4 both would be learned from 0.2 on, from 0.3 on only the first.
    map = ViewMixtures.empty()
    learn(map, view(0, 0), state([0, 0, 0]))
    two = state([10, 0, 0], [20, 0, 0], weights=[3.0, 2.0])
    monkeypatch.setattr("omninav.stages.mapping.adaptive_views.MIN_SIMILARITY", 0.3)
    learn(map, view(0.5, 0), two)
    assert map.means[:, 0].tolist() == [0.0, 10.0]
    monkeypatch.setattr("omninav.stages.mapping.adaptive_views.MIN_SIMILARITY", 0.2)
    learn(map, view(0.5, 0), two)
    assert sorted(map.means[:, 0].tolist()) == [0.0, 10.0, 20.0]


def test_states_are_as_wide_as_asked_in_position_and_heading():
    map = ViewMixtures.empty()
    learn(map, view(0, 0), state([0, 0, 0], sigma=0.01), min_sigma_m=0.3, min_sigma_deg=10.0)
    assert np.sqrt(np.diag(map.covariances[0])) == pytest.approx([0.3, 0.3, np.radians(10.0)])
    nothing = GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.zeros(1))
    before = map.weights.copy()
    assert learn(map, view(5.0, 0), nothing).inserted.tolist() == []
    assert map.weights.tolist() == before.tolist()


def test_an_event_says_why_views_went_and_what_changed():
    map = ViewMixtures.empty()
    stage = AdaptiveViews(**FREE, max_views=2)
    events = []
    for n in range(3):
        updates = MapUpdates((MapUpdate(view(5.0 * n, 0), state([9.0 * n, 0, 0]), 30 + n),))
        events.append(stage.step(Context("mapping"), updates, LIMIT, map, PendingUpdates()).events)
    assert [event.why for event in events] == ["", "", "full"]
    assert [event.removed.tolist() for event in events] == [[], [], [0]]
    assert [event.seen.tolist() for event in events] == [[30], [31], [32]]
    assert [event.changed.tolist() for event in events] == [[0], [1], [2]]
    assert map.steps == 3
