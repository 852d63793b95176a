"""Errors of homing vectors by distance, of made-up vectors."""

import math
from typing import Literal

import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.homing.first_view_target import FirstViewTarget, FirstViewTargetState
from omninav.stages.metrics.homing_field import HomingFieldErrors
from omninav.stages.plots.homing_vectors import ShowHomingVectors
from omninav.stages.source.homing_grid import grid_around
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Pose

CTX = Context("m")
POSES = [Pose(0.0, 0.0, 0.4), Pose(0.5, 0.0, math.pi), Pose(0.0, 1.5, 0.0), Pose(0.0, -1.6, 0.0)]


def vector(direction: float, turn: float, state: Literal["new", "lost"] = "new") -> HomingVector:
    return HomingVector(1, direction, turn, 1.0, 1.0, 1.0, None, 20, state)


def field(poses: list[Pose | None], vectors: list[HomingVector | None], **parameters: float) -> HomingFieldErrors.Out:
    return HomingFieldErrors(**parameters).step(CTX, poses, vectors)


def values_of(poses: list[Pose | None], vectors: list[HomingVector | None], **parameters: float) -> dict:
    return field(poses, vectors, **parameters).metrics.values["homing_field"]


# From (0.5, 0) looking back the target is ahead, and 0.4 - pi to turn; from (0, 1.5) it is to the right.
VECTORS = [None, vector(0.1, 0.4 - math.pi), vector(-math.pi / 2 - 0.3, 0.6), vector(0.0, 0.0, "lost")]


def test_errors_are_angles_to_the_true_way_and_lost_views_count_as_half_a_turn() -> None:
    values = values_of(POSES, VECTORS, rings=3)
    assert (values["views"], values["found_rate"]) == (3, pytest.approx(2 / 3))
    angles = [values[name] for name in ("median_deg", "of_found_deg", "turn_deg")]
    assert np.radians(angles) == pytest.approx([0.3, 0.2, 0.1])
    assert values["by_distance"]["views"] == [1, 2, 0]
    assert values["by_distance"]["median_deg"][::2] == [pytest.approx(math.degrees(0.1)), None]
    assert values["within"]["views"] == [1, 3, 3]
    assert values["within"]["found_rate"][1] == pytest.approx(2 / 3)


def test_the_picture_has_a_dart_for_each_view_that_has_a_vector_and_one_for_the_target() -> None:
    shown = field(POSES, VECTORS).field
    assert shown is not None
    plot = ShowHomingVectors().step(CTX, shown).plot
    assert plot is not None
    assert plot.content.count(b"<polygon") == np.isfinite(shown.directions).sum() + 1
    assert "From 3 views" in plot.caption
    assert ShowHomingVectors().step(CTX).plot is None


def test_without_another_view_there_is_no_field() -> None:
    out = field(POSES[:1], [None])
    assert out.metrics is out.field is None


def test_every_tick_but_the_first_has_a_target_of_its_own() -> None:
    nothing = np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 128), np.uint8)
    views = [
        LocalFeatures(*nothing, np.zeros((0, 3), np.float32), np.zeros(0, np.float32))
        for _ in grid_around((0, 0, 0), 1, 1)
    ]
    stage, first = FirstViewTarget(), FirstViewTargetState()
    outs = [stage.step(CTX, first, Tick(n, n), view) for n, view in enumerate(views)]
    assert outs[0].target is None
    assert [out.target.number for out in outs[1:]] == [1, 2, 3]
    assert all(out.target.features is views[0] and out.features is views[0] for out in outs[1:])


def test_a_view_at_the_edge_of_two_rings_is_in_the_inner_one(monkeypatch: pytest.MonkeyPatch) -> None:
    poses = [Pose(0.0, 0.0, 0.0), *[Pose(-x, 0.0, 0.0) for x in (0.5, 1.0, 2.0, 2.5)]]
    values = values_of(poses, [None, *[vector(0.0, 0.0)] * 4], rings=2)
    assert values["views"] == 4
    assert values["by_distance"]["to_m"] == [1.0, 2.0]
    assert values["by_distance"]["views"] == [2, 1]
    assert values["within"]["views"] == [2, 3]
    monkeypatch.setattr("omninav.stages.metrics.homing_field.WIDTH_M", 2.5)
    wide = values_of(poses, [None, *[vector(0.0, 0.0)] * 4])["by_distance"]
    assert wide["views"] == [4, *[0] * 7]
    assert wide["to_m"] == [2.5 * k for k in range(1, 9)]


def test_views_without_a_true_pose_or_a_vector_are_told_apart() -> None:
    poses = [Pose(0.0, 0.0, 0.0), Pose(-1.0, 0.0, 0.0), None, Pose(-2.0, 0.0, 0.0), Pose(-3.0, 0.0, 0.5)]
    out = field(poses, [None, vector(0.0, 0.0), vector(0.0, 0.0), None, vector(0.25 - 0.5, 0.0)])
    assert out.metrics.values["homing_field"]["found_rate"] == pytest.approx(2 / 3)
    assert out.field.inliers.tolist() == [20, 0, 20]
    assert out.field.directions == pytest.approx([0.0, math.nan, 0.25], nan_ok=True)
    assert field([None, *poses[1:]], [None] * 5).metrics is None


def test_errors_are_medians_of_angles_the_short_way_around() -> None:
    poses = [Pose(0.0, 0.0, 3.0), *[Pose(float(x), 0.0, -3.0) for x in (1, 2, 3)]]
    ahead = math.pi + 3.0
    vectors = [None, *[vector(ahead + off, 6.0 + off) for off in (0.1, -0.2, 0.9)]]
    values = values_of(poses, vectors)
    assert values["of_found_deg"] == pytest.approx(math.degrees(0.2))
    assert values["turn_deg"] == pytest.approx(math.degrees(0.2))
