"""Images that agree with the estimate speak for it, others against it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.monitor.confidence_monitor import (
    ConfidenceMonitor,
    ConfidenceMonitorState,
    best_place,
    by_landmarks,
    leads_of_best,
    mass_within,
    share_counted,
    share_found,
)
from omninav.stages.monitor.consistency import log_odds_of_right
from omninav.stages.monitor.wrong_pose_agreement import LearnWrongPoseAgreement
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.confidence import PoseConfidence, WrongPoseAgreement
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.landmarks import LandmarkFix, Landmarks
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.track import Track
from omninav.stages.values.visual_words import words_of

SCALE = LengthScale(0.3)


def map_of(poses: np.ndarray, features: np.ndarray) -> ReferenceGraph:
    return ReferenceGraph(poses, features, "histograms", np.zeros((0, 2), np.int64), "truth")


LINE = map_of(
    np.column_stack([np.arange(40.0), np.zeros((40, 2))]),
    np.random.default_rng(0).dirichlet(np.ones(20), (40, 8)).astype(np.float32),
)
HERE = np.zeros((5, 3))
"""Poses of a belief that is sure of the first reference's place."""


def alike(row: int = 0, others: float = 0.0, every: int = 1, columns: int = 36) -> Similarities:
    """An image that is most like one reference, and somewhat like all others or every so-many-th."""
    values = np.zeros((len(LINE), columns), np.float32)
    values[::every, 0] = others
    values[row, 0] = 0.9
    return Similarities(values)


def judged(
    monitor: ConfidenceMonitor,
    poses: np.ndarray,
    seen: Similarities | None,
    recent: ConfidenceMonitorState | None = None,
    tick: Tick | None = None,
    map: ReferenceGraph = LINE,
    scale: LengthScale = SCALE,
    **inputs: Any,
) -> PoseConfidence:
    """Asks the monitor about a belief of poses of equal weight."""
    belief, ctx = Particles(poses, np.full(len(poses), 1 / len(poses))), Context("monitor")
    ctx.tick = tick or ctx.tick
    recent = recent or ConfidenceMonitorState()
    wrong = WrongPoseAgreement(0.02)
    return monitor.step(ctx, recent, belief, belief.estimate(), map, scale, wrong, seen, **inputs).confidence


def drive(matches: list[int | None], **more: Any) -> list[float]:
    """Confidences along a line, as `stated`."""
    return [each.probability for each in stated(matches, **more)]


def stated(
    matches: list[int | None],
    at: float = 0.0,
    step: float = 1.0,
    spread: float = 0.05,
    novelty: float = 1.0,
    elsewhere: float = 0.0,
    every: int = 2,
    map: ReferenceGraph = LINE,
    features: LocalFeatures | None = None,
    fixes: Sequence[LandmarkFix | None] = (),
    carried_at: int | None = None,
) -> list[PoseConfidence]:
    """Confidences and states along a line; the best match of each image is given (None: no image), `elsewhere` the
    similarity of all references or of every so-many-th, and the estimate follows odometry."""
    monitor, recent, rng = ConfidenceMonitor(), ConfidenceMonitorState(), np.random.default_rng(1)
    found = []
    for n, match in enumerate(matches):
        poses = np.array([at + step * n, 0.0, 0.0]) + rng.normal(0.0, spread, (500, 3))
        inputs: dict[str, Any] = {
            "motion": Motion(step, 0.0, 0.0) if n else None,
            "track": Track(True, n == carried_at),
        }
        inputs["fix"] = fixes[n] if n < len(fixes) else None
        if match is not None:
            inputs |= {"likelihood": Likelihood(np.ones(500), novelty=novelty if n else 1.0), "features": features}
        seen = None if match is None else alike(match, elsewhere, every)
        found.append(judged(monitor, poses, seen, recent, Tick(n, n * 10**9, first_of_log=n == 0), map, **inputs))
    return found


def test_matches_along_the_estimated_path_make_it_sure_and_scattered_ones_do_not():
    scattered = np.random.default_rng(2).permutation(40)[:20].tolist()
    assert drive(list(range(20)))[-1] > 0.95
    assert drive(scattered)[-1] < 0.5
    assert drive([n + 20 for n in range(20)])[-1] < 0.5  # consistent, but elsewhere


def test_a_robot_searches_until_it_is_sure_is_lost_when_it_no_longer_is_and_blind_without_images():
    scattered = np.random.default_rng(2).permutation(40)[:12].tolist()
    assert {each.state for each in stated(scattered)[3:]} == {"searching"}
    kidnapped = [each.state for each in stated([*range(15), *range(25, 29), *range(19, 21)])]
    assert kidnapped[14] == kidnapped[-1] == "tracking"
    assert kidnapped[18] == "lost"
    blind = [each.state for each in stated([*range(15), None, None, None, None, 19])]
    assert blind[14:] == ["tracking", "tracking", "tracking", "blind", "blind", "tracking"]


def test_in_the_dark_agreeing_images_say_nothing_and_localise_no_robot():
    recent, rng, states = ConfidenceMonitorState(), np.random.default_rng(1), []
    for n, spread in enumerate((30.0, 30.0, 30.0, 0.05, 0.05, 0.05)):  # the belief settles without having seen anything
        poses, tick = np.array([n, 0.0, 0.0]) + rng.normal(0.0, spread, (500, 3)), Tick(n, n, first_of_log=n == 0)
        seen = {"features": features(7 if n < 5 else 200), "likelihood": Likelihood(np.ones(500))}
        states.append(judged(ConfidenceMonitor(), poses, alike(n), recent, tick, **seen).state)
        assert len(recent.places) == (n == 5)
    assert states == [*["searching"] * 5, "tracking"]


def test_it_falls_when_images_stop_to_agree_and_more_with_each():
    told = drive([*range(12), *[39 - n for n in range(18)]])
    assert told[11] > 0.9
    assert (np.diff(told[12:22]) < 0.0).all()
    assert told[-1] < 0.5


def test_a_wide_belief_is_less_sure_than_a_narrow_one():
    assert drive(list(range(8)), spread=1.0)[-1] < drive(list(range(8)))[-1] - 0.1


def test_a_robot_in_a_mode_wider_than_the_tolerance_is_tracked_though_its_pose_is_uncertain():
    told = stated(list(range(8)), spread=0.4)[-1]
    assert told.probability < 0.5  # within 0.5 m are 54 %, within 10 degrees 33 % of a spread of 23 degrees
    assert told.of_mode > 0.6
    assert told.state == "tracking"
    lost = stated([n + 20 for n in range(20)], spread=0.4)[-1]
    assert lost.of_mode < 0.1
    assert lost.state == "searching"


def test_a_robot_that_stands_gains_little_from_the_same_image_again():
    once, standing = drive([0])[-1], drive([0] * 6, step=0.0, novelty=0.05)[-1]
    assert standing < drive(list(range(6)))[-1] - 0.02
    assert standing == pytest.approx(once, abs=0.15)


def test_a_kidnapped_robot_is_doubted_after_few_images_and_trusted_again_with_the_first_right_one():
    told = drive([*range(15), *range(25, 29), *range(19, 21)])  # four images see other places
    assert told[14] > 0.99
    assert told[18] < 0.5
    assert told[19] > 0.5


def test_images_that_resemble_all_places_neither_convince_nor_cast_doubt():
    away = list(range(39, 27, -1))
    unclear = drive([*range(12), *away], elsewhere=0.89)
    assert unclear[-1] == pytest.approx(drive([0], elsewhere=0.89)[-1], abs=0.15)
    assert drive([*range(12), *range(12, 24)])[-1] > 0.95
    assert drive(list(range(12)), elsewhere=0.89)[-1] < 0.8


def test_images_that_resemble_many_places_but_not_the_estimates_cast_doubt():
    sure = list(range(15))
    many = drive([*sure, *range(39, 29, -1)], elsewhere=0.89, every=15)  # 0, 15 and 30, which is not near
    beyond = drive([*sure, *range(39, 29, -1)], at=-200.0, elsewhere=0.89, every=15)
    assert many[14] < 0.8  # each of them alone is of several places
    assert many[-1] < 0.2 < many[14]
    assert (np.diff(beyond[15:]) < 0.05).all()


def test_an_image_that_contradicts_the_estimate_counts_fully_and_its_repetitions_as_the_filter_says():
    told = drive([*range(15), *range(30, 35)], novelty=0.2)
    drop = -np.diff(told[14:20])
    assert drop[0] > 2.0 * drop[1] > 0.0


def test_a_way_without_images_lowers_the_confidence_and_standing_does_not():
    sure = list(range(15))
    blind, standing = drive([*sure, *[None] * 20]), drive([*sure[:1], *[None] * 20], step=0.0)
    assert blind[14] > 0.99
    assert (np.diff(blind[14:30]) < 0.0).all()
    assert blind[-1] < 0.9
    assert standing[-1] == pytest.approx(standing[0], abs=0.01)


def test_chance_is_small_where_images_are_taken_everywhere_and_large_where_all_look_like_one():
    ctx = Context("chance")
    apart = LearnWrongPoseAgreement().step(ctx, LINE, SCALE).when_wrong.share
    views = np.repeat(LINE.features[:1], 40, axis=0)
    views[::4] += np.float32(1e-4)  # these few look the most like all others
    alike = map_of(LINE.poses * (0.05, 1.0, 1.0), views)
    assert apart < 0.03
    assert LearnWrongPoseAgreement(within_m=0.2).step(ctx, alike, LengthScale(0.05)).when_wrong.share > 0.1


def test_chance_in_a_map_of_one_image_is_the_least(monkeypatch: pytest.MonkeyPatch):
    lone = map_of(LINE.poses[:1], LINE.features[:1])
    assert LearnWrongPoseAgreement().step(Context("chance"), lone, SCALE).when_wrong.share == 0.005
    monkeypatch.setattr("omninav.stages.monitor.wrong_pose_agreement.MIN_SHARE", 0.1)
    assert math.isclose(LearnWrongPoseAgreement().step(Context("chance"), lone, SCALE).when_wrong.share, 0.1)


def test_images_are_forgotten_as_new_ones_come_and_hardly_while_the_robot_stands():
    monitor, recent = ConfidenceMonitor(), ConfidenceMonitorState()

    def weight_of_first(images: int, novelty: float) -> float:
        for _ in range(images):
            judged(monitor, HERE, alike(), recent, likelihood=Likelihood(np.ones(1), novelty=novelty))
        return float(recent.weights[0])

    assert weight_of_first(1, 1.0) == pytest.approx(1.0, abs=1e-3)
    assert weight_of_first(50, 0.05) == pytest.approx(math.exp(-50 * 0.05 / 20.0), abs=1e-3)
    assert weight_of_first(20, 1.0) == pytest.approx(math.exp(-(50 * 0.05 + 20) / 20.0), abs=1e-3)


def test_images_taken_close_by_do_not_tell_how_often_a_wrong_place_looks_right():
    # Two pairs of images 20 cm apart, 10 m from each other; all look alike, each pair a little more. That an image's
    # best match is its own neighbour tells nothing of a robot that is elsewhere: without it, each pair looks like the
    # other one, so that wrong places agree.
    one = np.random.default_rng(3).dirichlet(np.ones(20), 8).astype(np.float32)
    other = 0.9 * one + np.float32(0.1) * np.random.default_rng(4).dirichlet(np.ones(20), 8).astype(np.float32)
    poses = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [10.0, 0.0, 0.0], [10.2, 0.0, 0.0]])
    pairs = map_of(poses, np.stack([one, one, other, other]))
    assert LearnWrongPoseAgreement().step(Context("chance"), pairs, LengthScale(0.3)).when_wrong.share == 0.5


@pytest.mark.parametrize(
    ("heading", "other", "expected"),
    [
        (-0.5, 0.5, (3 * 1 / 3) / 4),
        (3.1, -3.1, (2 * 1 / 2 + 1.974 / 3) / 4),
        (1.0, 1.05, (2 * 1 / 2 + 1.997 / 3) / 4),
    ],
)
def test_a_pose_at_the_same_place_is_wrong_where_it_is_turned_away(heading: float, other: float, expected: float):
    # Two images of one place, another place 10 m away that looks the same, and one 20 m away that looks like nothing
    # else, which tells nothing. Of the others the best match is one wrong pose of three, their place's image that is
    # turned among them; 0.083 rad (across pi) or 0.05 apart that one is right, and one of two is wrong; the third image
    # agrees with both: exp(-(0.083 / 0.175)^4 / 2) = 0.974.
    look, unlike = np.random.default_rng(3).dirichlet(np.ones(20), (2, 8)).astype(np.float32)
    poses = np.array([[0.0, 0.0, heading], [0.0, 0.0, other], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    places = map_of(poses, np.stack([look, look, look, unlike]))
    share = LearnWrongPoseAgreement().step(Context("chance"), places, LengthScale(0.3)).when_wrong.share
    assert share == pytest.approx(expected, abs=0.01)


def test_inputs_that_mislead_lower_the_confidence():
    def sure(conflicts: Conflicts | None) -> float:
        told = judged(ConfidenceMonitor(), HERE, alike(), conflicts=conflicts)
        assert told.of_mode == pytest.approx(told.probability)
        return told.probability

    alone = sure(None)
    assert alone > 0.5
    said = ("the camera is frozen",)
    assert sure(Conflicts(said, (), False)) == alone
    assert sure(Conflicts(said, said, False)) == alone
    assert sure(Conflicts(said, said, True)) == pytest.approx(0.2 * alone)


@pytest.mark.parametrize("column", [0, 9, 30])
def test_the_best_place_is_the_most_similar_references_turned_as_the_view_is(column: int):
    poses = np.array([[0.0, 0.0, 0.5], [3.0, 4.0, -1.0], [8.0, 8.0, 2.0]])
    values = np.full((2, 36), 0.1, np.float32)
    values[1, column] = 0.9
    map = map_of(poses, LINE.features[:3])
    place = best_place(Similarities(values, np.array([0, 2])), map)
    assert place[:2] == pytest.approx((8.0, 8.0))
    assert math.remainder(place[2] - 2.0 - math.radians(10 * column), math.tau) == pytest.approx(0.0, abs=1e-6)
    one = Similarities(np.array([[0.9], [0.1]], np.float32))  # one heading says no turn
    assert best_place(one, map) == pytest.approx(poses[0])


def test_the_best_match_leads_matches_elsewhere_and_those_near_the_estimate():
    values = np.full((40, 36), 0.2, np.float32)
    # Row 5 lies near the best one, turned by 20 degrees.
    values[4, 0], values[5, 34], values[2, 0], values[20, 0] = 0.8, 0.7, 0.5, 0.4
    unit = values.max(axis=1).std()
    leads = leads_of_best(Similarities(values), LINE, np.array([20.0, 1.0, 2.0]), 1.5)
    assert leads.place == pytest.approx((4.0, 0.0, 0.0))
    assert leads.over_elsewhere * unit == pytest.approx(0.3, rel=1e-5)
    assert leads.over_estimate * unit == pytest.approx(0.4, rel=1e-5)
    assert leads_of_best(Similarities(values), LINE, np.array([20.0, 9.0, 2.0]), 1.5).over_estimate == 0.0
    values[5, 32] = 0.75  # seen from another heading it is elsewhere
    assert leads_of_best(Similarities(values), LINE, np.zeros(3), 1.5).over_elsewhere * unit == pytest.approx(
        0.05, rel=0.1
    )


def test_the_mass_within_a_tolerance_counts_position_and_heading_by_weight():
    poses = np.array([[0.3, 0.3, math.pi], [0.3, 0.3, -math.pi + 0.1], [0.3, 0.3, 0.0], [0.5, 0.5, math.pi]])
    belief = Particles(poses, np.array([0.2, 0.4, 0.6, 0.8]))
    assert mass_within(belief, np.array([0.0, 0.0, -math.pi]), 0.5, 0.2) == pytest.approx(0.3)
    assert mass_within(belief, np.array([0.0, 0.0, -math.pi]), 0.5, 0.05) == pytest.approx(0.1)
    assert mass_within(belief, np.array([0.0, 0.0, -math.pi]), 0.8, 0.2) == pytest.approx(0.7)


@pytest.mark.parametrize(("metres", "scale"), [(0.5, 2.0), (2.0, 0.5)])
def test_matches_agree_within_the_wider_of_tolerance_and_length_scale(metres: float, scale: float):
    def sure(within_m: float, length_scale_m: float) -> float:
        beside = alike(1, columns=1)  # 1 m from the estimate
        return judged(ConfidenceMonitor(within_m=within_m), HERE, beside, scale=LengthScale(length_scale_m)).probability

    assert sure(metres, scale) == pytest.approx(sure(2.0, 2.0))
    assert sure(0.5, 0.5) < sure(metres, scale) - 0.1


def fix(x: float, probability: float) -> LandmarkFix:
    return LandmarkFix(np.array([[x, 0.0, 0.0]]), np.eye(3)[None], np.array([50]), np.array([probability]), 60)


def features(number: int) -> LocalFeatures:
    rows = [np.ones((number, width), np.float32) for width in (3, 2, 3)]
    return LocalFeatures(
        rows[0].astype(np.float64), rows[1].astype(np.float64), np.ones((number, 128), np.uint8), rows[2],
        np.ones(number, np.float32),
    )  # fmt: skip


def line_with_landmarks(found_rate: float) -> ReferenceGraph:
    words = words_of([np.full((1, 128), 1, np.uint8)], np.ones((1, 128), np.float32))
    landmarks = Landmarks(
        np.zeros((1, 3), np.float32), np.zeros((1, 128), np.uint8), np.zeros(41, np.int64), np.zeros(0, np.int32),
        0.001, words, found_rate, "",
    )  # fmt: skip
    return replace(LINE, landmarks=landmarks)


def test_until_landmarks_are_found_matches_that_agree_are_not_believed():
    """Images of another building agree with each other too, and have as many features."""
    map = line_with_landmarks(1.0)
    way = list(range(20))
    found = [fix(float(x), 0.99) for x in range(10)]
    told = stated(way, map=map, features=features(200), fixes=[*found, None, None, fix(12.0, 0.99)], carried_at=10)
    assert [each.state for each in told[9:13]] == ["tracking", "lost", "lost", "tracking"]
    assert max(drive(way, map=map, features=features(200))) < 0.05
    assert drive(way, map=map, features=features(10))[-1] > 0.9  # dark images show no landmarks on the map either
    blind = drive([*way, None, None, None], map=map, features=features(200))
    assert max(blind) < 0.05  # nor by driving on without images
    told = drive(way, map=map, features=features(200), fixes=[None, None, fix(2.0, 0.99)])
    assert told[1] < 0.05
    assert min(told[2:12]) > 0.9  # once found, some images without a pose change little


def test_landmarks_speak_for_the_pose_they_give_and_their_absence_against_every_pose():
    here, gate = np.zeros(3), (0.5, math.radians(10.0))

    agreeing, sure = by_landmarks(0.0, fix(0.0, 0.99), 1.0, here, gate, 1.0, 2.0)
    assert agreeing == pytest.approx(math.log(0.992 / 0.002))  # it may be wrong however many agree
    assert sure == pytest.approx(0.99)
    # At once, whatever was known before: 1 % of what is left of that, and of the rest at most one in fifty.
    kept = math.log(0.998665 / 0.001335)  # of 0.999665, a robot that may have been carried since
    known = 0.01 * kept + 0.99 * math.log(50.0)
    against = by_landmarks(8.0, fix(8.0, 0.99), 1.0, here, gate, 1.0, 2.0)[0]
    assert against == pytest.approx(known + (0.99 + 0.01 * 0.2) * math.log(0.01), abs=1e-3)
    opposite = by_landmarks(-8.0, fix(0.0, 0.7), 1.0, here, gate, 1.0, 2.0)[0]
    assert opposite == pytest.approx(-0.3 * kept + 0.7 * math.log(0.715 / 0.015), abs=1e-3)
    two = replace(fix(8.0, 0.3), poses=np.array([[8.0, 0.0, 0.0], here]), probabilities=np.array([0.3, 0.6]))
    by_chance = 0.1 * (0.6 / 20.0 + 0.3) / 0.9
    assert by_landmarks(0.0, two, 1.0, here, gate, 1.0, 2.0)[0] == pytest.approx(
        math.log((0.6 + by_chance) / (0.3 + by_chance)), abs=1e-5
    )
    few, elsewhere, again = (
        by_landmarks(0.0, fix(x, 0.1), 1.0, here, gate, new, 2.0)[0] for x, new in ((0.0, 1.0), (8.0, 1.0), (0.0, 0.0))
    )
    assert few == pytest.approx(math.log(0.145 / 0.045))  # a wrong one lies at the estimate once in twenty times
    # It is rather wrong than right, and wrong in the next image too.
    assert elsewhere == pytest.approx((0.1 + 0.9 * 0.2) * math.log(0.9))
    assert again == pytest.approx(0.1 * few)
    for odds, probability, most in ((0.0, 0.1, 3.9), (5.0, 0.1, 3.9), (0.0, 0.49, 3.9), (0.0, 0.51, 6.6)):
        for _ in range(100):  # one wall misleads all images that show it
            odds = by_landmarks(odds, fix(0.0, probability), 1.0, here, gate, 0.5, 2.0)[0]
        assert odds == pytest.approx(most, abs=0.1)
    standing = by_landmarks(0.0, fix(0.0, 0.3), 1.0, here, gate, 1.0, 2.0)[0]
    for _ in range(5):  # the same image again, each a twentieth new
        standing = by_landmarks(standing, fix(0.0, 0.3), 1.0, here, gate, 0.05, 2.0)[0]
    assert 1.0 < standing / math.log(0.335 / 0.035) < 1.25
    once = by_landmarks(4.0, None, 1.0, here, gate, 1.0, 2.0)[0]
    kept = math.log(0.98105 / 0.01895)  # of 0.98201, less a 500th of what is above a half
    assert once == pytest.approx(kept + 0.2 * math.log(0.5 / 0.95), abs=1e-3)
    assert by_landmarks(-1.95, None, 1.0, here, gate, 1.0, 2.0)[0] == -2.0
    odds = 4.0
    for _ in range(60):
        odds, sure = by_landmarks(odds, None, 1.0, here, gate, 1.0, 2.0)
    assert odds < -1.5  # a map of which half the images and more have a pose, and sixty without
    assert sure == 0.0
    assert by_landmarks(0.0, None, 0.0, here, gate, 1.0, 2.0)[0] == 0.0  # of a map without landmarks nothing follows
    assert by_landmarks(4.0, None, 1.0, here, gate, 0.0, 2.0)[0] == pytest.approx(4.0)  # nor from the same image again


def test_what_landmarks_said_for_a_pose_speaks_against_another_to_which_the_estimate_jumps():
    map, way = line_with_landmarks(1.0), list(range(10))
    here = [fix(float(x), 0.4) for x in range(10)]

    def after(jump: float, seen: LandmarkFix | None) -> float:
        recent = ConfidenceMonitorState()
        for x, found in zip((*way, 10.0 + jump), (*here, seen), strict=True):
            inputs = {"motion": Motion(1.0, 0.0, 0.0), "features": features(200), "fix": found}
            judged(ConfidenceMonitor(), HERE + np.array((x, 0.0, 0.0)), alike(int(x)), recent, None, map, **inputs)
        return recent.geometry

    assert after(0.0, None) > 3.0  # it drives on
    assert after(20.0, None) < -3.0
    assert after(20.0, fix(30.0, 0.99)) > 3.0  # found by landmarks
    assert after(20.0, fix(30.0, 0.1)) < -1.5


def test_missed_landmarks_take_away_what_agreement_says_and_not_what_disagreement_does():
    def told(x: float, number: int, seen: LandmarkFix | None = None) -> float:
        """Log odds after an image whose best match lies at x, then one that has as many features."""
        state = ConfidenceMonitorState()
        state.add(np.array([x, 0.0, 0.0]), HERE[0], 1.0, 1.0, 0.0)
        map = line_with_landmarks(0.6)
        right = judged(ConfidenceMonitor(), HERE, None, state, map=map, features=features(number), fix=seen).probability
        return math.log(right / (1.0 - right))

    agreeing, disagreeing = told(0.0, 99), told(9.0, 99)  # the second image is dark
    one, none = np.ones(1), np.zeros(1)
    assert agreeing == pytest.approx(log_odds_of_right(one, none, one, 0.02, 20.0, 0.02))
    assert disagreeing == pytest.approx(log_odds_of_right(none, one, one, 0.02, 20.0, 0.02))
    assert told(0.0, 100) == pytest.approx(0.4 * agreeing + math.log(1.0 - 0.95 * 0.6))
    assert told(9.0, 100) == pytest.approx(disagreeing + math.log(1.0 - 0.95 * 0.6))
    alone, _ = by_landmarks(0.0, fix(0.0, 0.5), 0.0, np.zeros(3), (0.5, math.radians(10.0)), 0.0, 6.0)
    assert told(0.0, 99, fix(0.0, 0.5)) == pytest.approx(0.5 * agreeing + alone)


def test_a_robot_is_on_the_map_from_the_first_sure_pose_on_and_landmarks_say_less_far_from_references():
    def after(odds: float, found: bool, seen: LandmarkFix | None = None, step: float = 0.15) -> ConfidenceMonitorState:
        state, poses = ConfidenceMonitorState(geometry=odds, found=found), HERE + np.array((3.0, -1.5, 0.0))
        inputs = {"motion": Motion(step, 0.0, 0.0), "features": features(200), "fix": seen}
        judged(ConfidenceMonitor(), poses, None, state, map=line_with_landmarks(0.6), **inputs)
        return state

    # At five length scales from the nearest reference half as many are found, and half a scale is half an image.
    expected, _ = by_landmarks(3.0, None, 0.5 * 0.6, np.zeros(3), (0.5, 0.2), 0.5, 1.0)
    assert after(3.0, True).geometry == pytest.approx(expected)
    assert (after(-0.999, True).geometry, after(-6.2, False).geometry) == (-1.0, -6.0)  # no more is said against it
    assert [after(odds, False, step=0.0).found for odds in (4.58, 4.62)] == [False, True]
    assert [after(0.0, False, fix(50.0, sure)).found for sure in (0.89, 0.91)] == [False, True]


def test_a_robot_that_is_told_its_pose_begins_anew():
    state = ConfidenceMonitorState(sure=True, empty=5, geometry=9.0)
    assert (
        judged(ConfidenceMonitor(), np.diag((0.0, 9.0, 0.0)), None, state, restart=Reinitialise()).state == "searching"
    )
    assert (state.empty, state.geometry) == (1, 0.0)


def test_landmarks_are_missed_beside_references_and_not_where_the_map_shows_nothing():
    shares = [share_found(distance) for distance in (0.0, 2.0, 5.0, 8.0, math.inf)]
    assert shares == pytest.approx([1.0, 0.9824, 0.5, 0.0106, 0.0], abs=1e-4)  # halved by (distance / 5)^4


def test_an_image_counts_by_its_lead_fully_at_twice_that_at_which_it_counts_half():
    assert [share_counted(lead) for lead in (0.0, 0.35, 0.7, 1.4)] == pytest.approx([0.0, 1 / 17, 0.5, 16 / 17])


def test_an_image_fades_by_what_the_later_ones_count_and_is_carried_along():
    state, here = ConfidenceMonitorState(), np.zeros(3)
    for x in range(501):
        state.add(np.array([x, 0.0, 0.0]), here, 1.0, 0.5, 1.0)
    assert len(state.weights) == len(state.novelties) == len(state.estimates) == 500
    fading = np.exp(-np.array([2.0, 1.0, 0.0]) / 20.0)
    assert state.weights[-3:] == pytest.approx(0.5 * fading)
    assert state.contradictions[-3:] == pytest.approx(fading)
    state.move(Motion(1.0, 2.0, 0.5))
    assert state.places[0] == pytest.approx((2.0, 2.0, 0.5))
    assert state.estimates[0] == pytest.approx((1.0, 2.0, 0.5))


def test_a_dark_image_does_not_take_back_what_landmarks_said_against_an_estimate():
    assert by_landmarks(-6.0, None, 0.0, np.zeros(3), (0.5, 0.2), 0.0, 1.0)[0] == pytest.approx(-6.0)
    assert by_landmarks(-6.0, None, 1.0, np.zeros(3), (0.5, 0.2), 1.0, 1.0)[0] < -3.0
