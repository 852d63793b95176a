"""Particles weighed by the visibility areas they lie in, against equations 6 to 8 written out."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from made_beliefs import even
from made_references import references

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.probability.evidence import evidence_novelty
from omninav.stages.sensor.calibrated_similarity import likelihood_ratios
from omninav.stages.sensor.line_of_sight import axes_of, visibility_areas
from omninav.stages.sensor.visibility import BACKGROUND_WEIGHT, Visibility
from omninav.stages.sensor.visibility_index import looks_at, seen_from
from omninav.stages.sensor.visibility_similarity import CUTOFF_SIGMAS, mean_seen, sums_by_turn
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.grid import FREE, OCCUPIED, OccupancyGrid
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.visibility import VisibilityAreas

RNG = np.random.default_rng(3)


def a_room() -> OccupancyGrid:
    cells = np.full((30, 40), FREE, np.uint8)
    cells[[0, -1], :] = cells[:, [0, -1]] = OCCUPIED
    cells[10:13, 15:25] = cells[20:, 28] = OCCUPIED
    return OccupancyGrid(cells, 0.1, (-1.0, 2.0))


ROOM = a_room()
FREE_CELLS = ROOM.centres(*np.nonzero(ROOM.cells == FREE))
REFERENCES = np.column_stack([FREE_CELLS[RNG.integers(len(FREE_CELLS), size=25)], RNG.uniform(-3, 3, 25)])


def weighed(
    stage: Visibility,
    values: np.ndarray,
    poses: np.ndarray,
    areas: VisibilityAreas,
    at: np.ndarray = REFERENCES,
    inputs: tuple[object, ...] = (),
    **said: object,
) -> Visibility.Out:
    """Weighs particles at `poses` by the values of each reference at each heading."""
    stage.setup(Context("sensor"))
    alike = Similarities(values.astype(np.float32), **said)
    return stage.step(Context("sensor"), alike, even(poses), references(at), areas, *inputs)


def areas_of(sectors: int, number: int = 25) -> VisibilityAreas:
    """Makes areas of the first references, each with views in as many sectors."""
    return visibility_areas(REFERENCES[:number], ROOM, axes_of(sectors))


def some_poses(number: int) -> np.ndarray:
    return np.column_stack([RNG.uniform(-1.2, 3.2, number), RNG.uniform(1.8, 5.2, number), RNG.uniform(-9, 9, number)])


def wrapped(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi


def by_equation_7(areas, pose, values, otherwise, window, around, near=None, unknown=0.0):
    """The mean over all views j whose area holds the pose, with d(psi), worked view by view."""
    row, column = np.floor((pose[1::-1] - np.array(areas.origin[::-1])) / areas.resolution).astype(int)
    total, mass = unknown * otherwise, unknown
    headings = values.shape[1]
    for reference, sector in np.argwhere(areas.target >= 0):
        t = areas.target[reference, sector]
        inside = 0 <= row < areas.shape[0] and 0 <= column < areas.shape[1] and areas.mask(t)[row, column]
        if not inside:
            continue
        point = areas.points[t]
        direction = math.atan2(point[1] - pose[1], point[0] - pose[0])
        far = math.dist(REFERENCES[reference, :2], pose[:2])
        nearness = 1.0 if near is None else math.exp(-0.5 * (far / near) ** 2) * (far <= 3 * near)
        if around:
            seen = REFERENCES[reference]
            theirs = math.atan2(point[1] - seen[1], point[0] - seen[0])
            # turned as the headings differ, less the parallax of the point
            turn = (pose[2] - seen[2]) - (direction - theirs)
            total += nearness * float(
                np.interp(turn * headings / (2 * np.pi), np.arange(headings), values[reference], period=headings)
            )
            mass += nearness
        else:
            weight = nearness * window(abs(wrapped(pose[2] - direction)))
            total, mass = total + weight * values[reference, 0], mass + weight
    return total / mass if mass > 0 else otherwise


WINDOW_DEG = "omninav.stages.sensor.visibility.WINDOW_DEG"


def within_20_degrees(psi: float) -> float:
    return float(psi <= math.radians(20))


def test_an_ordinary_cameras_particles_weigh_what_equations_7_and_8_say():
    areas = areas_of(1)
    values = RNG.random((25, 1))
    looks, poses = looks_at(areas, REFERENCES), some_poses(300)
    groups = np.arange(len(looks.target))
    sums, number = sums_by_turn(looks, groups, np.arange(25), values, np.ones(25))
    found = mean_seen(poses, seen_from(areas, looks), groups, sums, number, 0.25, math.radians(20))
    words = [by_equation_7(areas, pose, values, 0.25, within_20_degrees, False) for pose in poses]
    assert np.allclose(found, words, atol=1e-5)
    assert 0.05 < (found != 0.25).mean() < 0.95


@pytest.mark.parametrize("sectors", [1, 5])
def test_particles_that_see_all_around_take_each_view_turned_to_where_they_see_its_point(sectors):
    # a wave between columns 10 degrees apart is at most (pi / 18)^2 / 8 / 2 = 0.002 off a line, which is drawn twice
    values = 0.5 + 0.5 * np.cos(np.arange(36) * np.pi / 18 + RNG.uniform(0, 6, (25, 1)))
    areas, poses = areas_of(sectors), some_poses(100)
    out = weighed(Visibility(distance_sigma_m=None), values, poses, areas).likelihood
    words = [by_equation_7(areas, pose, values, float(values.mean()), None, True) for pose in poses]
    assert np.allclose(out.values * values.max(), words, atol=0.004)
    assert out.mean_likelihood * values.max() == pytest.approx(values.mean(), rel=1e-5)


@pytest.mark.parametrize("sectors", [1, 5])
def test_views_count_less_the_farther_away_they_were_taken_where_that_is_asked_for(monkeypatch, sectors):
    monkeypatch.setattr(WINDOW_DEG, 20.0)
    areas, ahead = areas_of(sectors), sectors == 1
    values, stage = RNG.random((25, 1 if ahead else 36)), Visibility(distance_sigma_m=0.4)
    poses = some_poses(100)
    found = weighed(stage, values, poses, areas).likelihood.values * np.float32(values.max())
    values = values.astype(np.float32).astype(float)
    window, mean = within_20_degrees if ahead else None, float(values.mean())
    words = [by_equation_7(areas, pose, values, mean, window, not ahead, 0.4) for pose in poses]
    # an angle that is off by 0.005 degrees is off by 0.0005 columns of 10 degrees, between values 1 apart at most
    assert np.allclose(found, words, atol=1e-5 if ahead else 5e-4)
    assert 0.05 < (np.abs(found - values.mean()) > 1e-6).mean() < 0.95


@pytest.mark.parametrize("near", [0.15, 0.6])
def test_every_view_that_is_near_enough_to_count_is_listed_for_its_cell(near):
    areas = areas_of(5)
    looks = looks_at(areas, REFERENCES, each_view=True)
    starts, items, *_ = seen_from(areas, looks, CUTOFF_SIGMAS * near)
    lists = [set(items[a:b]) for a, b in itertools.pairwise(starts)]
    assert len(items) == sum(map(len, lists))
    middles = ROOM.centres(*np.divmod(np.arange(ROOM.cells.size), ROOM.cells.shape[1]))
    for g in range(len(looks.target)):
        seen, away = areas.mask(looks.target[g]).ravel(), np.abs(middles - looks.place[g])
        nearest = np.hypot(*np.maximum(away - 0.05, 0).T)  # of a cell's spots
        listed = np.array([g in cell for cell in lists])
        assert listed[seen & (nearest < CUTOFF_SIGMAS * near - 1e-9)].all()
        assert not listed[~seen | (np.hypot(*away.T) > CUTOFF_SIGMAS * near + 0.0708)].any()


def test_far_from_the_maps_origin_likelihoods_are_the_same():
    moved = np.array([4096.0, -8192.0, 0.0])
    grid = OccupancyGrid(ROOM.cells, ROOM.resolution, (ROOM.origin[0] + moved[0], ROOM.origin[1] + moved[1]))
    values, poses = RNG.random((25, 36)), some_poses(300)
    here = weighed(Visibility(), values, poses, areas_of(5)).likelihood.values
    areas = visibility_areas(REFERENCES + moved, grid, axes_of(5))
    there = weighed(Visibility(), values, poses + moved, areas, REFERENCES + moved).likelihood.values
    assert np.allclose(there, here, atol=1e-4)


def test_a_robot_at_a_references_own_pose_takes_it_as_it_is():
    values = (0.5 + 0.5 * np.cos(np.arange(36) * np.pi / 18 + 1.0))[None]
    for column in (0, 9, 20):
        pose = REFERENCES[:1] + np.array([0, 0, 2 * np.pi * column / 36])
        out = weighed(Visibility(), values, pose, areas_of(7, 1), REFERENCES[:1])
        assert out.likelihood.values[0] * values.max() == pytest.approx(values[0, column], abs=0.004)


def test_where_no_area_holds_a_pose_its_likelihood_is_the_mean_similarity_to_the_database():
    values = RNG.random((25, 1))
    far = np.array([[50.0, 50.0, 0.0], [-0.95, 2.05, 0.0]])  # outside of the grid; in a wall
    out = weighed(Visibility(), values, far, areas_of(1)).likelihood
    assert np.allclose(out.values * values.max(), values.mean())
    assert out.mean_likelihood * values.max() == pytest.approx(values.mean(), rel=1e-6)


def test_references_that_were_not_compared_count_nowhere_and_sampled_ones_count_by_their_weight():
    areas, stage, some = areas_of(3), Visibility(distance_sigma_m=None), np.array([1, 4, 7, 20])
    values, poses, compared = RNG.random((25, 36)), some_poses(300), np.isin(np.arange(25), some)[:, None]
    found = weighed(stage, values[some], poses, areas, candidates=some).likelihood
    only = replace(areas, target=np.where(compared, areas.target, -1).astype(np.int32))
    words = weighed(stage, np.where(compared, values, 0.0), poses, only).likelihood
    known = np.abs(words.values - words.mean_likelihood) > 1e-9
    assert np.allclose(found.values[known], words.values[known], atol=1e-6)
    twice = weighed(stage, values[some], poses, areas, candidates=some, sampling_weight=np.full(4, 2.0))
    assert np.allclose(twice.likelihood.values, found.values, atol=1e-6)


def test_the_mean_of_the_database_counts_a_sampled_reference_as_all_that_it_stands_for():
    values, far = np.array([[1.0], [0.4], [0.2]]), np.array([[50.0, 50.0, 0.0]])
    sample = {"candidates": np.array([3, 8, 20]), "sampling_weight": np.array([1.0, 4.0, 15.0])}
    found = weighed(Visibility(), values, far, areas_of(1), **sample).likelihood
    assert found.mean_likelihood == pytest.approx((1.0 + 4 * 0.4 + 15 * 0.2) / 20)
    assert found.values == pytest.approx(found.mean_likelihood)


def test_images_of_a_standing_robot_are_little_evidence_with_an_independence_distance():
    assert evidence_novelty(0.1, 0.0) == 1.0
    assert evidence_novelty(None, 0.5) == 1.0
    assert evidence_novelty(0.0, 0.5) == 0.05
    assert evidence_novelty(0.1, 0.5) == pytest.approx(0.2)
    values, poses, stage = RNG.uniform(0.5, 1.0, (25, 1)), some_poses(50), Visibility(independence_distance=0.75)
    moving, standing = (
        weighed(stage, values, poses, areas_of(1), inputs=(motion, LengthScale(0.4))).likelihood
        for motion in (Motion(0.3, 0.0, 0.0), Motion(0.0, 0.0, 0.1))
    )
    assert (moving.novelty, standing.novelty) == pytest.approx((1.0, 0.05))
    assert np.allclose(standing.values, moving.values**0.05)


def test_calibrated_views_count_less_the_farther_off_they_were_taken_and_an_unknown_place_as_the_whole_map(monkeypatch):
    monkeypatch.setattr(WINDOW_DEG, 20.0)
    areas = areas_of(1)
    values, poses = RNG.uniform(0.5, 1.0, (25, 1)).astype(np.float32), some_poses(200)
    calibration = SimilarityCalibration(slope=3.0, middle=0.5, images=50, right_distance_m=0.5, correlation_m=2.0)
    stage, reach = Visibility(distance_sigma_m=0.4, independence_distance=1.0), LengthScale(0.4)
    found = weighed(stage, values, poses, areas, inputs=(None, reach, calibration))
    moved = Motion(0.01, 0.0, 0.0), reach, calibration
    carried = weighed(stage, values, poses, areas, inputs=moved, last_view=float(values.min()) / 2)
    assert carried.likelihood.carried > 0.02
    ratios = likelihood_ratios(Similarities(values), calibration).astype(float)
    raised = ratios / ratios.max()
    mean = float(raised.mean())
    assert found.likelihood.mean_likelihood == pytest.approx(mean)
    expected = [
        by_equation_7(areas, pose, raised, mean, within_20_degrees, False, 0.4, BACKGROUND_WEIGHT) for pose in poses
    ]
    assert np.allclose(found.likelihood.values, expected, atol=1e-5)
    assert found.field is not None
    assert found.field.floor == pytest.approx(1.0 / float(ratios.max()))
    assert found.field.mean == pytest.approx(np.maximum(raised, found.field.floor).mean())


def test_the_field_of_view_follows_from_the_match():
    poses, one = some_poses(100), RNG.random((25, 1))
    ahead = weighed(Visibility(), one, poses, areas_of(1)).likelihood.values
    around = weighed(Visibility(), np.repeat(one, 36, axis=1), poses, areas_of(1)).likelihood.values
    assert not np.allclose(ahead, around)


def test_an_empty_map_weights_all_particles_alike():
    assert (weighed(Visibility(), np.zeros((0, 36)), some_poses(5), areas_of(1)).likelihood.values == 1).all()


def test_areas_of_another_map_are_refused_in_one_line():
    with pytest.raises(BadInput, match="25 references, the visibility areas are of 3"):
        weighed(Visibility(), RNG.random((25, 1)), some_poses(5), areas_of(1, 3))


def test_without_retrieval_all_particles_in_any_area_weigh_alike():
    areas, poses = areas_of(1, 3), some_poses(400)
    anywhere = sum(areas.mask(t).astype(int) for t in range(len(areas.points))) > 0
    stage = Visibility(retrieval=False)
    values = weighed(stage, RNG.random((3, 36)), poses, areas, REFERENCES[:3]).likelihood.values
    for pose, value in zip(poses, values, strict=True):
        row, column = np.floor((pose[1::-1] - np.array(areas.origin[::-1])) / areas.resolution).astype(int)
        inside = 0 <= row < 30 and 0 <= column < 40 and anywhere[row, column]
        assert value == float(inside)
    assert set(values) == {0.0, 1.0}
