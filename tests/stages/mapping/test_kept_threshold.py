"""A map keeps the limit that it was learned with."""

import math
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.artifact import read_artifact, write_artifact
from omninav.stages.mapping.adaptive_views import AdaptiveViews
from omninav.stages.mapping.calibrated_threshold import CalibratedThreshold, CalibratedThresholdState
from omninav.stages.mapping.fused_mixtures import FusedMixtures, FusedMixturesState
from omninav.stages.mapping.pending_updates import PendingUpdates
from omninav.stages.match.neighbours import ViewNeighbours
from omninav.stages.metrics.view_map_size import stored_bytes
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.pose import Motion
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients, NoveltyThreshold

STEP_M = 0.3
WAVES, PHASES = np.random.default_rng(0).uniform(-2.0, 2.0, (2, 40))
MAPPINGS = {"fused": (FusedMixtures, FusedMixturesState), "adaptive": (AdaptiveViews, PendingUpdates)}
both = pytest.mark.parametrize("mapping", MAPPINGS)


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
        where = GaussianMixture(np.array([[x, 0.0, 0.0]]), np.eye(3)[None] * 0.01, np.ones(1))
        learn.step(ctx, MapUpdates((MapUpdate(seen_at(x), where, n),)), limit, map, learned)
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
