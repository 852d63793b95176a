"""Views are learned long after they were seen: what is told of the map goes by when they were seen."""

import math

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.mapping.adaptive_views import AdaptiveViews
from omninav.stages.mapping.calibrated_threshold import CalibratedThreshold, CalibratedThresholdState
from omninav.stages.mapping.delayed_by_distance import DelayedByDistance, DelayedByDistanceState
from omninav.stages.mapping.fused_mixtures import FusedMixtures, FusedMixturesState
from omninav.stages.mapping.unimodal_queue import UnimodalQueue, UnimodalQueueState
from omninav.stages.mapping.view_updates import PendingUpdates
from omninav.stages.metrics.map_history import MapHistory
from omninav.stages.metrics.mislocalised_references import MislocalisedReferences
from omninav.stages.plots.changed_mixtures import ChangedMixtures
from omninav.stages.values.belief import GaussianMixture, PoseEstimate
from omninav.stages.values.pose import Motion, Pose, UncertainMotion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients

LAP, LAPS, ROUND_M = 95, 3, 42.0
"""0.44 m a picture: there is a limit after 20 of them, settled after 100, and views wait for nine more."""
SIGMAS = np.diag([0.05, 0.05, 0.02])


WAYS = {
    "left_behind": lambda: (DelayedByDistance(), DelayedByDistanceState(), FusedMixtures(), FusedMixturesState()),
    "at_once": lambda: (UnimodalQueue(length=0), UnimodalQueueState(), AdaptiveViews(), PendingUpdates()),
}


@pytest.fixture(scope="module", params=WAYS)
def told(request):
    # The limit is measured, views wait to be left behind, and the state is the true pose: laps are alike in all.
    rng = np.random.default_rng(0)
    waves, phases = rng.normal(0.0, 1.0, (2, 60)), rng.uniform(0.0, 2 * math.pi, 60)
    step, radius = 2 * math.pi / LAP, ROUND_M / (2 * math.pi)
    limit, first = CalibratedThreshold(), CalibratedThresholdState()
    changes, map = ChangedMixtures(), ViewMixtures.empty()
    lessons, waiting, mapping, learned = WAYS[request.param]()
    ctx = Context("late")
    ticks, truth, motions, events, mixtures = [], [], [], [], []
    for n in range(LAP * LAPS + 1):
        ctx.tick = Tick(n, n * 10**9, 0, n, n == 0)
        angle = (n % LAP) * step
        pose = np.array([radius * math.cos(angle), radius * math.sin(angle), float(wrap(angle + math.pi / 2))])
        values = np.cos(pose[:2] @ waves + phases).astype(np.float32)
        view, state = Coefficients(values, values[None]), GaussianMixture(pose[None], SIGMAS[None] ** 2, np.ones(1))
        motion = Motion(radius * step, 0.0, step) if n else None
        model = UncertainMotion((step / 2, radius * step, step / 2), (0.01, 0.03, 0.01)) if n else None
        due = lessons.step(ctx, view, state, model, waiting).updates
        event = mapping.step(ctx, due, limit.step(ctx, view, motion, first).threshold, map, learned).events
        ticks.append(ctx.tick)
        truth.append(Pose(*pose))
        motions.append(motion)
        events.append(event)
        mixtures.append(changes.step(ctx, map, event).mixtures)
    return ticks, truth, motions, events, mixtures


def test_no_reference_is_new_after_the_first_lap_where_all_laps_are_alike(told):
    ticks, truth, motions, events, _ = told
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in truth]
    found = MapHistory().step(Context("history"), collected(ticks, truth, motions, estimates), events).metrics.values
    assert found["map_per_lap"]["frames"][0] < LAP + 5
    assert found["map"]["inserted"] > 20
    assert found["map"]["new_after_first_lap_rate"] == 0.0


def test_no_place_is_wrong_where_every_state_was_right_however_many_are_learned_in_one_tick(told):
    ticks, truth, _, events, mixtures = told
    assert max(len(event.inserted) for event in events if event is not None) > 3
    found = MislocalisedReferences().step(Context("wrong"), collected(ticks, truth), events, mixtures).metrics.values
    assert found["mislocalised_references"] == {"references": 0}


def test_the_beginning_of_the_way_is_in_the_map_though_it_was_driven_before_there_was_a_limit(told):
    _, truth, _, events, _ = told
    seen = np.sort(np.concatenate([event.seen for event in events if event is not None]))
    apart = np.diff([truth[n].x + 1j * truth[n].y for n in seen[seen < LAP]])
    assert seen[0] == 0
    assert np.abs(apart).max() < 2.0


def test_an_event_says_in_which_tick_each_reference_was_seen(told):
    _, truth, _, events, _ = told
    for event in events:
        if event is not None:
            came = np.isin(event.changed, event.inserted)
            true = np.array([(truth[n].x, truth[n].y) for n in event.seen]).reshape(-1, 2)
            np.testing.assert_allclose(event.places[came], true, atol=0.5)
