"""The paper's second experiment on made-up views: carried away and turned round in the first lap of ten."""

import functools
import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.fusion.conditional_resampling import ConditionalResampling
from omninav.stages.fusion.growing_prior import ParticlesInMap
from omninav.stages.fusion.particle_clustering import ParticleClustering
from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.mapping.delayed_by_distance import DelayedByDistance, DelayedByDistanceState
from omninav.stages.mapping.fixed_lag_smoother import FixedLagSmoother, FixedLagSmootherState
from omninav.stages.mapping.fused_mixtures import FusedMixtures, FusedMixturesState
from omninav.stages.match.neighbours import ViewNeighbours
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.sensor.superposition import Superposition
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, WholeView

Array = npt.NDArray[np.float64]
RADIUS, STEPS, LAPS, LIMIT = 3.0, 60, 10, 0.5
CARRIED = [*range(STEPS // 4 + 1), *range(3 * STEPS // 4, LAPS * STEPS)]
"""From O to A, a quarter on, carried to B, turned by 180 degrees, then round and round."""
BEACONS = np.random.default_rng(5).uniform(-5.0, 5.0, (40, 2))


class Beacons(WholeView):
    """How near each of 40 beacons is, and, for the turn alone, the heading."""

    def distances(self, kept: npt.NDArray[np.float32]) -> Array:
        return np.linalg.norm(self.values[:-1].astype(float) - kept[:, :-1], axis=1)

    def turns(self, kept: npt.NDArray[np.float32]) -> Array:
        return wrap(float(self.values[-1]) - kept[:, -1].astype(float))


def seen_from(pose: Array) -> Beacons:
    near = np.exp(-0.5 * ((BEACONS - pose[:2]) ** 2).sum(axis=1))
    return Beacons(np.append(near, pose[2]).astype(np.float32))


def on_circle(steps: float) -> Array:
    angle = 2 * math.pi * steps / STEPS
    return np.array([RADIUS * math.cos(angle), RADIUS * math.sin(angle), float(wrap(angle + math.pi / 2))])


def drive(places: list[int], drift: float) -> tuple[list[Array], list[Motion | None]]:
    """True poses and odometry, which turns by `drift` (rad) too much at each picture."""
    rng = np.random.default_rng(6)
    poses = [on_circle(n) for n in places]
    motions: list[Motion | None] = [None]
    for n, m in itertools.pairwise(places):
        step = between(on_circle(m - 1), on_circle(m)) if m - n > 1 else between(on_circle(n), on_circle(m))
        motions.append(Motion(*(step + rng.normal(0.0, (0.01, 0.005, 0.005)) + (0.0, 0.0, drift))))
    return poses, motions


@functools.cache
def run(
    reconstruct_path: bool = True, carried: bool = True, drift: float = 0.0, back_propagate: bool = False
) -> tuple[Array, list[float], Array, ViewMixtures]:
    """Errors per picture (m), the wrong weight of the view at B after each, the lap each belongs to, and the map."""
    places = CARRIED if carried else list(range(3 * STEPS))
    poses, motions = drive(places, drift)
    names = ("first", "motion", "fusion", "rest")
    ctx = {name: Context(name, np.random.default_rng(n)) for n, name in enumerate(names)}
    known, limit, queue = ViewMixtures.empty(), NoveltyThreshold(LIMIT), DelayedByDistanceState()
    path, learned = FixedLagSmootherState(), FusedMixturesState()
    start, move, fuse = ParticlesInMap(number=500), RotationTranslationRotation(), ConditionalResampling()
    match, sensor, gather = ViewNeighbours(), Superposition(), ParticleClustering()
    correct = FixedLagSmoother(reconstruct_path=reconstruct_path, back_propagate=back_propagate)
    delay, learn = DelayedByDistance(), FusedMixtures()
    errors, wrong, belief = [], [], None
    for n, (pose, motion) in enumerate(zip(poses, motions, strict=True)):
        for each in ctx.values():
            each.tick = Tick(n, n, 0, n, n == 0)
        view = seen_from(pose)
        neighbours = match.step(ctx["rest"], view, known, limit).neighbours
        hypothesis = sensor.step(ctx["rest"], neighbours, known).hypothesis
        belief = start.step(ctx["first"], known, Pose(*map(float, pose))).belief or belief
        assert belief is not None
        moved = move.step(ctx["motion"], belief, motion, MeasuredNoise())
        belief = fuse.step(ctx["fusion"], moved.belief, hypothesis).belief
        state = gather.step(ctx["rest"], belief).state
        past = correct.step(ctx["rest"], view, state, moved.model, path, neighbours, known).corrections
        updates = delay.step(ctx["rest"], view, state, moved.model, queue, past).updates
        known = learn.step(ctx["rest"], updates, limit, known, learned).map
        at = belief.estimate().pose
        errors.append(math.hypot(at.x - pose[0], at.y - pose[1]))
        wrong.append(wrong_weight(known))
    return np.array(errors), wrong, np.array(places) // STEPS, known


def wrong_weight(map: ViewMixtures) -> float:
    """Of the view nearest to what is seen at B: the weight of its places more than 2 m from there."""
    if not len(map):
        return 0.0
    at_b = on_circle(3 * STEPS // 4)
    row = int(np.argmin(seen_from(at_b).distances(map.views)))
    if seen_from(at_b).distances(map.views)[row] > 0.5:
        return 0.0
    mine = map.owner == row
    far = np.hypot(*(map.means[mine, :2] - at_b[:2]).T) > 2.0
    return float(map.weights[mine][far].sum())


def test_the_robot_is_found_again_when_it_comes_to_a_place_that_it_mapped_before_it_was_carried_away() -> None:
    errors, _, laps, _ = run()
    carried = np.flatnonzero(laps == 0)[STEPS // 4 + 1 :]
    assert errors[carried[:-2]].min() > 2.0  # nothing in the map can tell yet
    home = np.flatnonzero(laps == 1)
    assert errors[home[2 : STEPS // 2]].max() < 0.5  # by the second or third picture at O, through the 80/20 branch


def test_a_wrong_place_is_forgotten_lap_by_lap_and_removed() -> None:
    _, wrong, laps, _ = run()
    after = [wrong[int(np.flatnonzero(laps == lap)[-1])] for lap in range(LAPS)]
    assert after[0] == pytest.approx(1.0)
    assert after[1] < 1.0
    assert after[2] < 0.5 * after[1]
    assert max(after[4:]) == 0.0


def test_once_back_at_the_start_the_path_from_b_is_corrected_and_the_error_falls() -> None:
    errors, _, laps, _ = run()
    lap = [float(errors[laps == n].mean()) for n in range(LAPS)]
    assert lap[0] > lap[1] > lap[2] > lap[3]
    assert max(lap[3:]) < 0.3


def test_without_path_reconstruction_the_wrong_stretch_moves_on() -> None:
    errors, _, laps, _ = run(reconstruct_path=False)
    place = np.arange(STEPS)
    right_up_to = []
    for lap in (1, 3, 6):
        wrong = (errors[laps == lap] > 1.0) & (place >= 3 * STEPS // 4)
        right_up_to.append(int(place[wrong].min(initial=STEPS)))
    assert right_up_to[0] < right_up_to[1] < right_up_to[2]
    assert errors[laps == LAPS - 1].mean() > 1.0


def test_a_closed_loop_takes_back_what_odometry_drifted_in_it_where_nobody_lifts_the_robot() -> None:
    later, components = [], []
    for back_propagate in (False, True):
        errors, _, laps, known = run(carried=False, drift=0.004, back_propagate=back_propagate)
        later.append(float(errors[laps > 0].mean()))
        components.append(len(known.weights))
    assert later[1] < 0.9 * later[0]
    assert components[1] <= 1.2 * components[0]
