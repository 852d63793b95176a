"""The first particles of a log."""

import numpy as np
import pytest
from made_references import references
from made_ticks import at_tick

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.grid import FreeSpace
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Pose

MAP = references([[5.0, 5.0, 0.0]])
TRUTH = Pose(3.0, 4.0, 3.1)


def begun(stage: ParticlePrior, first: bool = True, **ports: object) -> Particles | None:
    return stage.step(at_tick(7, first), ports.pop("map", MAP), ports.pop("truth", TRUTH), **ports).belief


@pytest.mark.parametrize(("scale", "reach"), [(None, 1.5), (LengthScale(0.2), 0.6)])
def test_a_uniform_start_reaches_some_length_scales_from_each_reference(
    monkeypatch: pytest.MonkeyPatch, scale: LengthScale | None, reach: float
) -> None:
    monkeypatch.setattr("omninav.stages.fusion.particle_prior.RADIUS", 3.0)
    belief = begun(ParticlePrior(number=2000), length_scale=scale)
    assert belief is not None
    from_reference = np.hypot(belief.poses[:, 0] - 5.0, belief.poses[:, 1] - 5.0)
    assert from_reference.max() == pytest.approx(reach, rel=0.02)
    assert from_reference.max() <= reach
    assert (from_reference < reach / 2).mean() == pytest.approx(0.25, abs=0.05)  # uniform over a disc
    assert belief.weights.sum() == pytest.approx(1.0)
    assert len(set(belief.weights)) == 1


def test_a_uniform_start_is_spread_over_all_references_or_the_free_space_where_it_is_wired() -> None:
    belief = begun(ParticlePrior(number=4000), map=references([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]]))
    assert belief is not None
    assert (belief.poses[:, 0] < 4).mean() == pytest.approx(0.5, abs=0.03)
    belief = begun(ParticlePrior(number=4000), area=FreeSpace(np.array([[50.5, 50.5], [51.5, 50.5]]), 1.0))
    assert belief is not None
    assert belief.poses[:, 0].min() >= 50
    assert belief.poses[:, 0].mean() == pytest.approx(51, abs=4 * (2 / 12**0.5) / 4000**0.5)
    assert np.abs(belief.poses[:, 2]).max() == pytest.approx(np.pi, abs=0.01)


@pytest.mark.parametrize("at", ["uniform", "truth"])
def test_a_start_that_lacks_what_it_needs_says_what_to_type(at: str) -> None:
    with pytest.raises(BadInput, match="start="):
        begun(ParticlePrior(at=at), map=None, truth=None)


@pytest.mark.parametrize(
    ("at", "place", "spread"),
    [
        ("truth", (3.0, 4.0), (0.1, 0.1, 0.1)),
        ("origin", (0.0, 0.0), (0.1, 0.1, 0.1)),
        ((1.0, 2.0, 3.1, 0.4, 0.2), (1.0, 2.0), (0.4, 0.4, 0.2)),
    ],
)
def test_a_known_start_has_the_spread_that_is_said_and_headings_within_half_a_turn(
    at: object, place: tuple[float, float], spread: tuple[float, float, float]
) -> None:
    belief = begun(ParticlePrior(at=at, number=4000))
    assert belief is not None
    assert belief.poses[:, :2].mean(axis=0) == pytest.approx(place, abs=0.02)
    assert belief.poses[:, :2].std(axis=0) == pytest.approx(spread[:2], rel=0.1)
    mean = np.angle(np.exp(1j * belief.poses[:, 2]).mean())
    assert np.angle(np.exp(1j * (belief.poses[:, 2] - mean))).std() == pytest.approx(spread[2], rel=0.1)
    assert np.abs(belief.poses[:, 2]).max() <= np.pi
    assert mean == pytest.approx(0.0 if at == "origin" else 3.1, abs=0.02)


def test_a_belief_begins_again_where_somebody_asks_for_it() -> None:
    stage = ParticlePrior(at="origin", number=500)
    assert begun(stage, first=False) is None
    assert begun(stage) is not None
    there = begun(stage, first=False, restart=Reinitialise((9.0, -9.0, 0.0, 0.1, 0.1)))
    anywhere = begun(stage, first=False, restart=Reinitialise())
    assert there is not None
    assert anywhere is not None
    assert there.poses.mean(axis=0) == pytest.approx([9.0, -9.0, 0.0], abs=0.03)
    assert anywhere.poses[:, :2].mean(axis=0) == pytest.approx([5.0, 5.0], abs=0.2)


@pytest.mark.parametrize(
    ("source", "at", "warned"), [("odometry", "truth", 1), ("truth", "truth", 0), ("odometry", "origin", 0)]
)
def test_a_true_start_in_a_map_of_odometry_is_warned_of(source: str, at: str, warned: int) -> None:
    ctx = at_tick(first=True)
    ParticlePrior(at=at).step(ctx, references([[5.0, 5.0, 0.0]], source=source), TRUTH)
    assert len(ctx.warnings) == warned
