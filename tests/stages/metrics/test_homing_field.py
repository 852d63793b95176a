"""Errors of homing vectors by distance, of made-up vectors."""

import math
from typing import Literal

import numpy as np
import pytest

from omninav.pipeline import Context
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


def judged() -> HomingFieldErrors.Out:
    # From (0.5, 0) looking back the target is ahead, and 0.4 - pi to turn; from (0, 1.5) it is to the right.
    vectors = [None, vector(0.1, 0.4 - math.pi), vector(-math.pi / 2 - 0.3, 0.6), vector(0.0, 0.0, "lost")]
    return HomingFieldErrors(rings=3).step(CTX, POSES, vectors)


def test_errors_are_angles_to_the_true_way_and_lost_views_count_as_half_a_turn() -> None:
    values = judged().metrics.values["homing_field"]
    assert values["views"] == 3
    assert values["found_rate"] == pytest.approx(2 / 3)
    assert values["median_deg"] == pytest.approx(math.degrees(0.3))
    assert values["of_found_deg"] == pytest.approx(math.degrees(0.2))
    assert values["turn_deg"] == pytest.approx(math.degrees(0.1))
    by = values["by_distance"]
    assert by["views"] == [1, 2, 0]
    assert by["median_deg"][0] == pytest.approx(math.degrees(0.1))
    assert by["median_deg"][2] is None
    assert values["within"]["views"] == [1, 3, 3]
    assert values["within"]["found_rate"][1] == pytest.approx(2 / 3)


def test_the_picture_has_an_arrow_for_each_view() -> None:
    figure = ShowHomingVectors().step(CTX, judged().field).figure
    assert figure is not None
    assert figure.content.startswith(b"\x89PNG")
    assert "From 3 views" in figure.caption
    assert ShowHomingVectors().step(CTX).figure is None


def test_without_another_view_there_is_no_field() -> None:
    out = HomingFieldErrors().step(CTX, POSES[:1], [None])
    assert out.metrics is None
    assert out.field is None


def test_every_tick_but_the_first_has_a_target_of_its_own() -> None:
    from omninav.pipeline import Tick

    nothing = np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 128), np.uint8)
    views = [
        LocalFeatures(*nothing, np.zeros((0, 3), np.float32), np.zeros(0, np.float32))
        for _ in grid_around((0, 0, 0), 1, 1)
    ]
    stage, first = FirstViewTarget(), FirstViewTargetState()
    outs = [stage.step(CTX, first, Tick(n, n, first_of_log=n == 0), view) for n, view in enumerate(views)]
    assert outs[0].target is None
    assert [out.target.number for out in outs[1:]] == [1, 2, 3]
    assert all(out.target.features is views[0] and out.features is views[0] for out in outs[1:])
