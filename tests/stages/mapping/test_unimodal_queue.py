"""Lessons that wait: what is certain, what is worked out afterwards, what is dropped, and when each comes."""

import numpy as np
import pytest
from made_ticks import at_tick
from round_drive import look, place, way

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.unimodal_queue import UnimodalQueue, UnimodalQueueState
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.views import Coefficients

NARROW = np.diag([0.01, 0.01, 0.004])


def belief(tick, shares=(1.0,), covariance=NARROW):
    means = np.stack([place(tick) + np.array([5.0 * k, 0.0, 0.0]) for k in range(len(shares))])
    return GaussianMixture(means, np.stack([covariance] * len(shares)), np.array(shares))


class Drive:
    """Steps a queue through a drive around a ring; at `split` ticks the state has two modes, in `gaps` no odometry."""

    def __init__(self, split=(), starts=(0,), shift=0.0, gaps=(), **options):
        self.stage, self.pending, self.ctx = UnimodalQueue(**options), UnimodalQueueState(), Context("map_update")
        self.split, self.starts, self.shift, self.gaps = split, starts, shift, gaps
        self.came: dict[int, list] = {}
        self.waiting: list[list[int]] = []

    def to(self, ticks):
        for n in range(ticks):
            first = n in self.starts
            self.ctx.tick = Tick(n, n, 0, n, first)
            state = belief(n, (0.5, 0.5) if n in self.split else (1.0,))
            if n > max(self.split, default=0):
                state = GaussianMixture(state.means + np.array([self.shift, 0, 0]), state.covariances, state.weights)
            view = Coefficients(look(n), look(n)[None])
            model = None if first or n in self.gaps else way(n)
            out = self.stage.step(self.ctx, view, state, model, self.pending)
            self.came[n] = list(out.updates.items)
            self.waiting.append([update.index for update in out.waiting.items])
        return self

    def order(self):
        return [(update.index, tick) for tick, updates in self.came.items() for update in updates]


def test_an_update_is_given_length_ticks_after_its_view():
    assert Drive(length=3).to(6).order() == [(0, 3), (1, 4), (2, 5)]
    assert Drive(length=0).to(3).order() == [(0, 0), (1, 1), (2, 2)]


def test_at_the_next_log_all_waiting_updates_are_given():
    assert Drive(length=3, starts=(0, 4)).to(5).order() == [(0, 3), (1, 4), (2, 4), (3, 4)]


def test_views_between_two_unimodal_states_get_reconstructed_states_in_order():
    drive = Drive(split=range(5, 9), length=2).to(14)
    updates = [update for tick in drive.came.values() for update in tick]
    assert [update.index for update in updates] == list(range(12))
    assert [update.index for update in updates if update.reconstructed] == [5, 6, 7, 8]
    assert [update.index for update in drive.came[9]] == [5, 6, 7], "8 has not waited long enough"
    for update in updates:
        assert len(update.state) == 1
        assert update.state.weights.tolist() == [1.0]
        assert (update.state.means.shape, update.state.covariances.shape) == ((1, 3), (1, 3, 3))
        np.testing.assert_allclose(update.state.means[0, :2], place(update.index)[:2], atol=1e-6)
    assert drive.ctx.counts == {"view_reconstructed": 4}


@pytest.mark.parametrize("options", [{"reconstruct": False}, {"waiting": 2}, {"shift": 1.5}])
def test_views_in_between_are_dropped_where_the_path_is_unknown(monkeypatch: pytest.MonkeyPatch, options):
    monkeypatch.setattr("omninav.stages.mapping.unimodal_queue.MAX_WAITING", options.pop("waiting", 500))
    shift = options.pop("shift", 0.0)  # where the robot finds itself again is not where odometry led
    drive = Drive(split=range(5, 9), length=0, shift=shift, **options).to(12)
    assert [index for index, _ in drive.order()] == [*range(5), 9, 10, 11]
    assert drive.ctx.counts == {"view_not_learned": 4}


def test_without_a_gate_a_kidnapped_robots_path_is_reconstructed():
    drive = Drive(split=range(5, 9), length=0, shift=1.5, odometry_gate=0.0).to(12)
    assert len(drive.order()) == 12


def test_no_path_is_reconstructed_across_two_logs():
    drive = Drive(split=range(3, 6), starts=(0, 5), length=0).to(8)
    assert [index for index, _ in drive.order()] == [0, 1, 2, 6, 7]
    assert drive.pending.seen == []


def given(stage, state):
    view = Coefficients(look(0), look(0)[None])
    return stage.step(at_tick(first=True), view, state, None, UnimodalQueueState()).updates.items


def test_a_state_is_unimodal_by_the_share_near_its_heaviest_component():
    stage = UnimodalQueue(length=0, min_share=0.9)
    assert given(stage, belief(0, (0.91, 0.09)))
    assert not given(stage, belief(0, (0.89, 0.11)))
    near = belief(0, (0.6, 0.4))
    near.means[1] = near.means[0] + (0.2, 0.0, 0.0)  # 0.2^2 / 0.02 = 2 < 7.81
    (update,) = given(stage, near)
    # The two as one: 0.4 of the way, with 0.6 * 0.4 * 0.2^2 more variance along it.
    np.testing.assert_allclose(update.state.means[0], place(0) + np.array([0.08, 0.0, 0.0]))
    np.testing.assert_allclose(update.state.covariances[0, 0, 0], 0.01 + 0.24 * 0.04)


def test_what_waits_is_said_and_each_waits_the_same():
    assert Drive(split=range(2, 4), length=2).to(6).waiting == [[0], [0, 1], [1], [], [3, 4], [4, 5]]


def test_views_in_a_gap_of_the_odometry_are_dropped():
    drive = Drive(split=range(2, 6), gaps=[4], length=0).to(8)
    assert [index for index, _ in drive.order()] == [0, 1, 6, 7]
    assert drive.ctx.counts == {"view_not_learned": 4}


@pytest.mark.parametrize(
    ("options", "metres", "degrees", "certain"),
    [
        ({}, 3.0, 180.0 / 3**0.5, False),  # as wide as the map
        ({}, 30.0, 44.0, True),
        ({"max_sigma_deg": 10.0}, 30.0, 9.0, True),
        ({"max_sigma_deg": 10.0}, 0.5, 11.0, False),
    ],
)
def test_a_state_whose_heading_is_certain_enough_is_unimodal(options, metres, degrees, certain):
    wide = belief(0, covariance=np.diag([metres, metres, np.radians(degrees)]) ** 2)
    assert bool(given(UnimodalQueue(length=0, **options), wide)) == certain


def test_as_many_views_as_may_wait_are_reconstructed(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.mapping.unimodal_queue.MAX_WAITING", 4)
    assert Drive(split=range(5, 9), length=0).to(12).ctx.counts == {"view_reconstructed": 4}
    monkeypatch.setattr("omninav.stages.mapping.unimodal_queue.MAX_WAITING", 3)
    assert Drive(split=range(5, 9), length=0).to(12).ctx.counts == {"view_not_learned": 4}


def test_a_path_is_reconstructed_from_the_last_certain_state_only():
    # Uncertain from the very beginning, then certain, uncertain and certain: only the second stretch has two ends.
    drive = Drive(split=[0, 1, 4, 5], length=0).to(8)
    assert [index for index, _ in drive.order()] == [2, 3, 4, 5, 6, 7]
    assert drive.ctx.counts == {"view_not_learned": 2, "view_reconstructed": 2}
