"""What the mapping stages do with their own parameters: the numbers that papers give and pages rest on."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from made_beliefs import along_x
from made_references import references
from made_ticks import at_tick
from made_view_maps import view
from made_views import NO_FEATURES, between_looks, made_hypotheses, made_views
from made_words import features_of

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.calibrated_threshold import CalibratedThreshold, CalibratedThresholdState
from omninav.stages.mapping.delayed_by_distance import DelayedByDistance, DelayedByDistanceState
from omninav.stages.mapping.fused_mixtures import FusedMixtures, FusedMixturesState
from omninav.stages.mapping.keyframe_history import KeyframeHistory
from omninav.stages.mapping.learned_words import LearnVisualWords
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.mapping.reference_graph import LearnReferenceGraph, LearnReferenceGraphState
from omninav.stages.mapping.supervised_views import SupervisedViews
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.mapping.unimodal_queue import UnimodalQueue, UnimodalQueueState
from omninav.stages.mapping.view_comparison import ViewComparison
from omninav.stages.plots.thumbnails import ReferenceSnapshot, ThumbnailsState, TourSnapshot
from omninav.stages.sensor.appearance_length_scale import AppearanceLengthScale
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama
from omninav.stages.values.local_features import GlobalDescriptor, VerticalSegments
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.pose import Motion, Pose, UncertainMotion
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold

CTX = Context("mapping")


def test_a_threshold_is_half_the_median_of_the_first_hundred_views_twenty_apart() -> None:
    looks = np.random.default_rng(0).uniform(0.0, 100.0, 130).astype(np.float32).astype(np.float64)
    state, stage, step = CalibratedThresholdState(), CalibratedThreshold(), Motion(0.0101, 0.0, 0.0)
    found = [stage.step(CTX, view(look), step, state).threshold for look in looks]
    assert found[19] is None
    for seen in (21, 99, 100, 130):
        gaps, threshold = between_looks(looks[: min(seen, 100)]), found[seen - 1]
        assert threshold is not None
        assert threshold.distance == pytest.approx(0.5 * np.median(gaps[np.tril_indices(len(gaps), -20)]), rel=1e-6)
        assert threshold.settled == (seen >= 100)
    standing = CalibratedThresholdState()
    for _ in range(3):
        CalibratedThreshold().step(CTX, view(1.0), Motion(0.0049, 0.0, 0.0), standing)
    assert len(standing.views) == 1


def test_a_view_is_learned_after_four_metres_and_at_most_500_wait() -> None:
    stage, queue, given = DelayedByDistance(), DelayedByDistanceState(), []
    for tick in range(12):
        model = UncertainMotion((0.0, 0.5, 0.0), (0.0, 0.0, 0.0)) if tick else None
        given.append([u.index for u in stage.step(at_tick(tick), view(0.0), along_x(0.0), model, queue).updates.items])
    assert given == [[]] * 8 + [[0], [1], [2], [3]]
    standing = DelayedByDistanceState()
    for tick in range(502):
        stage.step(at_tick(tick), view(0.0), along_x(0.0), None, standing)
    assert len(standing.waiting) == 500


def test_a_queue_of_unimodal_states_is_twenty_ticks_long() -> None:
    # Gross, Koenig & Mueller 2005, section 2.1.
    stage, pending, given = UnimodalQueue(), UnimodalQueueState(), []
    for tick in range(23):
        given.append([u.index for u in stage.step(at_tick(tick), view(0.0), along_x(0.0), None, pending).updates.items])
    assert given == [[]] * 20 + [[0], [1], [2]]


@pytest.mark.parametrize(("squared", "share", "one"), [(7.8, 0.5, True), (7.82, 0.5, False), (7.82, 0.51, True)])
def test_a_state_is_unimodal_where_more_than_half_is_at_its_heaviest_component(
    squared: float, share: float, one: bool
) -> None:
    state = along_x(0.0, (2 * squared) ** 0.5 * 0.1, weights=(share, 1.0 - share))
    pending = UnimodalQueueState()
    UnimodalQueue().step(at_tick(), view(0.0), state, None, pending)
    assert (pending.last is not None) == one


@pytest.mark.parametrize(("missed", "explained"), [(16.2, True), (16.4, False)])
def test_odometry_explains_a_state_up_to_999_of_1000_drives(missed: float, explained: bool) -> None:
    # A metre ahead from 0.1 m to 0.1 m, with 0.1 m of its own: three variances of 0.01.
    stage, pending = UnimodalQueue(length=0), UnimodalQueueState()
    still = UncertainMotion((0.0, 0.5, 0.0), (1e-9, 0.1 * 0.5**0.5, 1e-9))
    end = along_x(1.0 + (missed * 0.03) ** 0.5)
    for tick, state in enumerate((along_x(0.0), along_x(0.0, 9.0), end)):
        out = stage.step(at_tick(tick), view(0.0), state, still if tick else None, pending)
    assert [update.index for update in out.updates.items] == ([1, 2] if explained else [2])


def fused(*updates: tuple[float, float]) -> ViewMixtures:
    map, pending = ViewMixtures.empty(), FusedMixturesState()
    items = tuple(MapUpdate(view(look), along_x(place), n) for n, (look, place) in enumerate(updates))
    FusedMixtures().step(CTX, MapUpdates(items), NoveltyThreshold(1.0), map, pending)
    return map


def test_components_of_a_fused_view_are_one_up_to_95_per_cent_with_the_spread_of_their_means() -> None:
    apart = (7.8 * 0.02) ** 0.5
    one = fused((0.0, 0.0), (0.0, apart))
    assert one.covariances[0, 0, 0] == pytest.approx(0.01 + apart**2 / 4)
    assert len(fused((0.0, 0.0), (0.0, (7.82 * 0.02) ** 0.5)).weights) == 2


def test_a_fused_map_keeps_what_weighs_a_hundredth_and_any_number_of_views() -> None:
    for weight, number in ((0.0099, 1), (0.0101, 2)):
        map = ViewMixtures.empty()
        update = MapUpdate(view(0.0), along_x(0.0, 9.0, weights=(1.0 - weight, weight)), 0)
        FusedMixtures().step(CTX, MapUpdates((update,)), NoveltyThreshold(1.0), map, FusedMixturesState())
        assert len(map.weights) == number
    assert len(fused(*[(9.0 * n, 0.0) for n in range(5)])) == 5


def ring(share: float) -> SegmentHistograms:
    """Similarity at one heading is the share of what is the same."""
    return SegmentHistograms(np.tile(np.array([share, 1.0 - share], np.float32), (4, 1)))


@pytest.mark.parametrize(
    ("drive", "kept"),
    [
        # Two centimetres apart or less than six tenths alike (Gross & Koenig 2004, section 2).
        ([(0.0, 1.0), (0.019, 1.0)], 1),
        ([(0.0, 1.0), (0.021, 1.0)], 2),
        ([(0.0, 1.0), (0.0, 0.61)], 1),
        ([(0.0, 1.0), (0.0, 0.59)], 2),
        # All within half a metre are compared: the last is unlike the nearest, and like the first.
        ([(0.0, 1.0), (0.495, 0.0), (0.495, 1.0)], 2),
        ([(0.0, 1.0), (0.505, 0.0), (0.505, 1.0)], 3),
    ],
)
def test_references_are_apart_or_unlike_those_around_them(drive: list[tuple[float, float]], kept: int) -> None:
    map, state = ReferenceGraph.empty(), LearnReferenceGraphState()
    for tick, (x, share) in enumerate(drive):
        LearnReferenceGraph().step(at_tick(tick, not tick), ring(share), None, Pose(x, 0.0, 0.0), map, state)
    assert len(map) == kept


@pytest.mark.parametrize(("step", "kept"), [(0.0099, 1), (0.0101, 2)])
def test_views_of_a_drive_are_kept_a_centimetre_apart(step: float, kept: int) -> None:
    sessions: Sessions | None = None
    for tick in range(2):
        motion = Motion(step, 0.0, 0.0) if tick else None
        sessions = KeyframeHistory().step(at_tick(tick, not tick), view(0.0), motion, along_x(0.0), sessions).sessions
    assert sessions is not None
    assert len(sessions) == kept


def test_a_supervised_view_is_seen_from_a_quarter_of_a_metre_and_ten_degrees_around() -> None:
    map = SupervisedViews().step(CTX, [view(0.0)], [Pose(1.0, 2.0, 0.5)]).map
    assert np.sqrt(np.diagonal(map.covariances[0])) == pytest.approx([0.25, 0.25, np.radians(10.0)])
    assert (map.weights.tolist(), map.counts.tolist(), map.steps) == ([1.0], [1.0], 1)


def test_a_map_of_less_than_ten_references_has_a_length_scale_of_half_a_metre() -> None:
    def scale(number: int) -> float:
        looks = np.zeros((number, 3, 40), np.float32)
        for n in range(number):
            looks[n, :, 2 * n : 2 * n + 6] = 1 / 6
        map = references(along_x(*range(number)).means, looks)
        return AppearanceLengthScale().step(CTX, map).length_scale.metres

    assert scale(9) == 0.5
    assert scale(10) != 0.5


def test_thumbnails_are_160_or_240_columns_wide_and_of_a_quality_of_75() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (60, 480, 3), dtype=np.uint8)
    map = ReferenceGraph.empty()
    map.insert(Pose(0.0, 0.0, 0.0), np.ones((1, 1), np.float32), "histograms")
    of_reference = ReferenceSnapshot().step(CTX, Panorama(pixels), map, ThumbnailsState()).snapshots
    assert of_reference is not None
    for (jpeg,), columns in (
        (of_reference.jpegs, 160),
        (TourSnapshot().step(CTX, Panorama(pixels)).snapshots.jpegs, 240),
    ):
        small = cv2.resize(pixels, (columns, columns // 8), interpolation=cv2.INTER_AREA)
        assert jpeg == cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 75])[1].tobytes()


def test_a_vocabulary_has_at_most_2048_words() -> None:
    looks = np.random.default_rng(0).integers(0, 256, (2100, 128)).astype(np.uint8)
    words = LearnVisualWords().step(CTX, [features_of(looks)], [ReferenceEvent(0, "first")]).words
    assert len(words.centres) == 2048


def test_views_are_compared_by_the_numbers_of_the_system() -> None:
    nothing = ViewComparison().step(CTX, [Tick(0, 0)], [NO_FEATURES], [GlobalDescriptor(np.zeros(3, np.float32))]).views
    assert nothing.options == (0.8, 0.8, 0.5, 8, pytest.approx(np.radians(0.5)), "euclidean")


def test_places_are_half_a_turn_wide_and_hypotheses_a_quarter_ignorant_up_to_twenty_views() -> None:
    def closed(looks: list[float], orders: list[int] | None = None, shares: np.ndarray | None = None):
        return LoopClosure().step(CTX, made_views(between_looks(looks), shares, orders=orders)).hypotheses

    assert closed([0.0, 0.49]).cluster.tolist() == [0, 0]
    assert closed([0.0, 0.51]).cluster.tolist() == [0, 1]
    assert closed([0.0, 9.0, 0.1]).initial[:, 2] == pytest.approx([0.25])
    looks = [0.0, 10.0, 0.1, 10.1]
    for far, told in ((19, True), (21, False)):
        found = closed(looks, [0, far, 100, 100])
        assert (found.masses != found.initial).any() == told
    for share, alike in ((0.39, False), (0.41, True)):
        assert (closed([0.0, 9.0, 0.1], shares=np.full((3, 3), share)).initial[0, 0] > 0.0) == alike


def test_no_view_is_passed_over_within_a_part_and_more_than_half_of_the_support_accepts() -> None:
    parts = LoopClosure().step(CTX, made_views(between_looks([0.0, 9.0, 0.1]))).hypotheses.subcluster
    assert parts.tolist() == [0, 1, 2]
    # The spread is 1 where parts are of one view: of the nearer two pairs the similarity is above a half, of the last
    # exp(-1.25^2 / 2) = 0.46; all are supported by more than half, unless the first two match too little to be alike.
    looks = between_looks([0.0, 10.0, 20.0, 0.1, 10.2, 21.25])
    shares = np.ones((6, 6))
    shares[0, 3] = shares[3, 0] = shares[1, 4] = shares[4, 1] = 0.1
    for match, accepted in ((np.ones((6, 6)), [True] * 3), (shares, [False] * 3)):
        found = LoopClosure(place_size=1.5).step(CTX, made_views(looks, match)).hypotheses
        assert found.accepted.tolist() == accepted == (found.masses[:, 0] > 0.5).tolist()


def test_of_a_view_sixty_segments_are_kept() -> None:
    number = 70
    columns = VerticalSegments(
        np.arange(number) / 100, np.zeros((number, 2)), np.zeros((number, 10), np.float32),
        np.ones(number, np.float32), np.zeros((number, 2, 2)),
    )  # fmt: skip
    one = replace(made_views(between_looks([0.0])), features=(replace(NO_FEATURES, columns=columns),))
    made = TopologicalMapping().step(CTX, one, made_hypotheses(one, [0])).map
    kept = made.views.features(0).columns
    assert kept is not None
    assert len(kept) == 60
