"""Both mappings of views wait for a limit, keep it with the map, and keep every figure within its bounds."""

import math
from pathlib import Path

import numpy as np
import pytest
from made_beliefs import along_x
from made_view_maps import view

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.mapping.adaptive_views import AdaptiveViews
from omninav.stages.mapping.calibrated_threshold import CalibratedThreshold, CalibratedThresholdState
from omninav.stages.mapping.frozen import Frozen
from omninav.stages.mapping.fused_mixtures import FusedMixtures, FusedMixturesState
from omninav.stages.mapping.view_updates import PendingUpdates
from omninav.stages.match.neighbours import ViewNeighbours
from omninav.stages.metrics.map_size import stored_bytes
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients, NoveltyThreshold

STEP_M = 0.3
WAVES, PHASES = np.random.default_rng(0).uniform(-2.0, 2.0, (2, 40))
MAPPINGS = {"fused": (FusedMixtures, FusedMixturesState), "adaptive": (AdaptiveViews, PendingUpdates)}
both = pytest.mark.parametrize("mapping", MAPPINGS)


LIMIT = NoveltyThreshold(1.0)


def seen_at(x: float) -> Coefficients:
    values = np.cos(WAVES * x + PHASES).astype(np.float32)
    return Coefficients(values, values[None])


def drive(
    places: list[float],
    mapping: str,
    map: ViewMixtures,
    first: CalibratedThresholdState,
    known: ViewMixtures | None = None,
) -> list[NoveltyThreshold | None]:
    """Along a line, each view learned at once: the limits by which it was compared."""
    measure, (stage, state) = CalibratedThreshold(views=40), MAPPINGS[mapping]
    learn, ctx, learned, limits = stage(), Context("drive"), state(), []
    for n, x in enumerate(places):
        ctx.tick = Tick(n, n, 0, n, n == 0)
        limit = measure.step(ctx, seen_at(x), Motion(STEP_M, 0.0, 0.0) if n else None, first, known).threshold
        learn.step(ctx, MapUpdates((MapUpdate(seen_at(x), along_x(x), n),)), limit, map, learned)
        limits.append(limit)
    return limits


FIRST = [STEP_M * n for n in range(60)]
THEN = [FIRST[-1] - 0.7 * STEP_M * n for n in range(60)]


@both
def test_a_map_takes_the_limit_once_it_is_settled(mapping: str) -> None:
    map, first = ViewMixtures.empty(), CalibratedThresholdState()
    assert drive(FIRST[:39], mapping, map, first)[-1].settled is False
    assert map.threshold is None
    limit = drive(FIRST[39:], mapping, map, first)[-1]
    assert limit.settled
    assert map.threshold is limit
    assert limit.metres > 0.0


@both
def test_a_saved_map_is_compared_by_its_own_limit_from_the_first_picture_on(mapping: str, tmp_path: Path) -> None:
    map, first = ViewMixtures.empty(), CalibratedThresholdState()
    drive(FIRST, mapping, map, first)
    write_artifact(tmp_path / "map.omap", map)
    loaded = read_artifact(tmp_path / "map.omap")
    assert isinstance(loaded, ViewMixtures)
    assert stored_bytes(loaded) == stored_bytes(map)

    in_one = drive(THEN, mapping, map, first)
    ctx, alone = Context("limit"), CalibratedThresholdState()
    limit = CalibratedThreshold(views=40).step(ctx, seen_at(THEN[0]), None, alone, loaded).threshold
    assert limit is not None
    assert ctx.facts["novelty_threshold"] == round(limit.distance, 4)
    near = ViewNeighbours().step(ctx, seen_at(THEN[0]), loaded, limit).neighbours
    assert near is not None
    assert math.isclose(loaded.means[loaded.owner == near.rows[0], 0][0], THEN[0], abs_tol=limit.metres)

    again = drive(THEN, mapping, loaded, CalibratedThresholdState(), known=loaded)
    assert {(each.distance, each.metres) for each in again} == {(each.distance, each.metres) for each in in_one}
    np.testing.assert_array_equal(loaded.views, map.views)
    np.testing.assert_array_equal(loaded.means, map.means)


def test_what_is_measured_is_that_of_the_drive_where_a_known_map_has_no_settled_limit() -> None:
    limits = drive(FIRST, "fused", ViewMixtures.empty(), CalibratedThresholdState(), known=ViewMixtures.empty())
    assert limits[0] is None
    assert limits[-1].settled


@both
def test_before_there_is_a_limit_only_the_first_update_is_applied(mapping: str) -> None:
    stage, waiting, map = MAPPINGS[mapping][0](), MAPPINGS[mapping][1](), ViewMixtures.empty()
    for n in range(3):
        updates = MapUpdates((MapUpdate(view(2.0 * n), along_x(n), n),))
        stage.step(Context("mapping"), updates, None, map, waiting)
        assert len(map) == 1
    event = stage.step(Context("mapping"), None, LIMIT, map, waiting).events
    assert map.means[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert (event.inserted.tolist(), event.seen.tolist()) == ([1, 2], [1, 2])
    assert not waiting.waiting


@both
def test_nothing_to_learn_leaves_the_map_alone_and_a_frozen_map_learns_nothing(mapping: str) -> None:
    stage, waiting, map = MAPPINGS[mapping][0](), MAPPINGS[mapping][1](), ViewMixtures.empty()
    for updates in (MapUpdates(()), None):
        out = stage.step(Context("mapping"), updates, LIMIT, map, waiting)
        assert out.map is map
        assert out.events is None
    updates = MapUpdates((MapUpdate(view(0.0), along_x(0.0), 0),))
    assert Frozen().step(Context("m"), map=map, updates=updates, threshold=LIMIT).map is map
    assert (len(map), map.steps) == (0, 0)


def random_stage(mapping: str, rng: np.random.Generator) -> FusedMixtures | AdaptiveViews:
    if mapping == "fused":
        average = str(rng.choice(["visits", "halves"]))
        return FusedMixtures(average=average, spread=bool(rng.random() < 0.5), max_views=12)
    forgetting, beta = str(rng.choice(["active", "passive", "none"])), rng.uniform(0.1, 1.0)
    return AdaptiveViews(forgetting=forgetting, beta=beta, max_views=12, min_sigma_m=0.0, min_sigma_deg=0.0)


@both
def test_over_thousands_of_updates_weights_stay_in_0_to_1_and_covariances_positive_definite(
    mapping: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("omninav.stages.mapping.adaptive_views.FORGET_GAIN", 5.0 / 0.3)
    rng, map, before = np.random.default_rng(0), ViewMixtures.empty(), MAPPINGS[mapping][1]()

    def random_lesson(least: float) -> MapUpdate:
        parts = int(rng.integers(1, 4))
        roots = rng.normal(0, 0.2, (parts, 3, 3))
        covariances = roots @ roots.transpose(0, 2, 1) + np.eye(3) * least
        weights = rng.random(parts) + 1e-3
        shares = weights / weights.sum() if mapping == "fused" else weights
        state = GaussianMixture(rng.normal(0, 1, (parts, 3)), covariances, shares)
        return MapUpdate(view(*rng.normal(0, 2.0, 2)), state, 0)

    for _ in range(200):
        stage, least = random_stage(mapping, rng), 10.0 ** rng.uniform(-6, -1)
        stage.step(Context("m"), MapUpdates(tuple(random_lesson(least) for _ in range(10))), LIMIT, map, before)
        assert map.weights.min() >= 0
        assert map.weights.max() <= 1
        assert (map.counts > 0).all()
        assert (np.bincount(map.owner, minlength=len(map)) > 0).all(), "no view without a place"
        if mapping == "fused":
            assert np.bincount(map.owner, map.weights, len(map)) == pytest.approx(1.0)
        np.testing.assert_array_equal(map.covariances, map.covariances.transpose(0, 2, 1))
        assert (np.linalg.eigvalsh(map.covariances) > 0).all()
        assert (np.abs(map.means[:, 2]) <= math.pi).all()
        assert len(map) <= 12
    assert map.steps == 2000
