"""Lessons that wait: what is certain, what is worked out afterwards, what is dropped, and when each comes."""

import numpy as np
import pytest
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
    """Steps a queue through a drive around a ring; `split` ticks are in two minds."""

    def __init__(self, split=(), starts=(0,), shift=0.0, **options):
        self.stage, self.waiting, self.ctx = UnimodalQueue(**options), UnimodalQueueState(), Context("lessons")
        self.split, self.starts, self.shift = split, starts, shift
        self.came: dict[int, list] = {}

    def to(self, ticks):
        for n in range(ticks):
            first = n in self.starts
            self.ctx.tick = Tick(n, n, 0, n, first)
            state = belief(n, (0.5, 0.5) if n in self.split else (1.0,))
            if n > max(self.split, default=0):
                state = GaussianMixture(state.means + np.array([self.shift, 0, 0]), state.covariances, state.weights)
            view = Coefficients(look(n), look(n)[None])
            out = self.stage.step(
                self.ctx, view=view, state=state, model=None if first else way(n), waiting=self.waiting
            )
            self.came[n] = list(out.updates.items)
        return self

    def order(self):
        return [(lesson.index, tick) for tick, lessons in self.came.items() for lesson in lessons]


def test_a_lesson_comes_so_many_ticks_after_its_view():
    assert Drive(length=3).to(6).order() == [(0, 3), (1, 4), (2, 5)]
    assert Drive(length=0).to(3).order() == [(0, 0), (1, 1), (2, 2)]


def test_at_the_next_log_what_waits_comes_at_once():
    assert Drive(length=3, starts=(0, 4)).to(5).order() == [(0, 3), (1, 4), (2, 4), (3, 4)]


def test_views_between_two_certain_states_come_with_the_way_worked_out_and_in_their_order():
    drive = Drive(split=range(5, 9), length=2).to(14)
    lessons = [lesson for tick in drive.came.values() for lesson in tick]
    assert [lesson.index for lesson in lessons] == list(range(12))
    assert [lesson.index for lesson in lessons if lesson.reconstructed] == [5, 6, 7, 8]
    assert [lesson.index for lesson in drive.came[9]] == [5, 6, 7], "8 has not waited long enough"
    for lesson in lessons:
        assert len(lesson.state) == 1
        assert lesson.state.weights.tolist() == [1.0]
        np.testing.assert_allclose(lesson.state.means[0, :2], place(lesson.index)[:2], atol=1e-6)
    assert drive.ctx.counts == {"view_reconstructed": 4}


@pytest.mark.parametrize("options", [{"reconstruct": False}, {"longest": 2}, {"shift": 1.5}])
def test_views_in_between_are_dropped_where_the_way_cannot_be_known(options):
    shift = options.pop("shift", 0.0)  # where the robot finds itself again is not where odometry led
    drive = Drive(split=range(5, 9), length=0, shift=shift, **options).to(12)
    assert [index for index, _ in drive.order()] == [*range(5), 9, 10, 11]
    assert drive.ctx.counts == {"view_not_learned": 4}


def test_a_lifted_robots_way_is_worked_out_where_that_is_asked_for():
    drive = Drive(split=range(5, 9), length=0, shift=1.5, missed_below=0.0).to(12)
    assert len(drive.order()) == 12


def test_a_way_is_not_worked_out_across_two_logs():
    drive = Drive(split=range(3, 6), starts=(0, 5), length=0).to(8)
    assert [index for index, _ in drive.order()] == [0, 1, 2, 6, 7]
    assert drive.waiting.seen == []


def certain(stage, state):
    view = Coefficients(look(0), look(0)[None])
    ctx = Context("lessons")
    ctx.tick = Tick(0, 0, 0, 0, True)
    return stage.step(ctx, view=view, state=state, model=None, waiting=UnimodalQueueState()).updates.items


def test_a_state_is_certain_by_the_share_of_what_is_near_its_heaviest_part():
    stage = UnimodalQueue(length=0, least_share=0.9)
    assert certain(stage, belief(0, (0.91, 0.09)))
    assert not certain(stage, belief(0, (0.89, 0.11)))
    near = belief(0, (0.6, 0.4))
    near.means[1] = near.means[0] + (0.2, 0.0, 0.0)  # 0.2^2 / 0.02 = 2 < 7.81
    (lesson,) = certain(stage, near)
    # The two as one: 0.4 of the way, with 0.6 * 0.4 * 0.2^2 more variance along it.
    np.testing.assert_allclose(lesson.state.means[0], place(0) + np.array([0.08, 0.0, 0.0]))
    np.testing.assert_allclose(lesson.state.covariances[0, 0, 0], 0.01 + 0.24 * 0.04)
    assert not certain(UnimodalQueue(length=0, unimodal="single"), near)


def test_a_state_that_is_one_part_but_as_wide_as_the_map_is_not_certain():
    anywhere = np.diag([9.0, 9.0, np.pi**2 / 3])
    assert not certain(UnimodalQueue(length=0), belief(0, covariance=anywhere))
    adrift = np.diag([9.0, 9.0, 0.1])
    assert certain(UnimodalQueue(length=0), belief(0, covariance=adrift))
    assert not certain(UnimodalQueue(length=0, most_m=1.0), belief(0, covariance=adrift))
