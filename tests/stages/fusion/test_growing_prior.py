import numpy as np
import pytest

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.growing_prior import MixtureInMap, ParticlesInMap
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import ViewMixtures


def context(first: bool = True) -> Context:
    ctx = Context("first_belief", np.random.default_rng(0))
    ctx.tick = Tick(0, 0, 0, 0, first)
    return ctx


def two_places() -> ViewMixtures:
    map = ViewMixtures.empty()
    for x in (0.0, 10.0):
        map.add_component(
            map.add_view(np.array([x], np.float32), "Coefficients"), np.array([x, 0, 0]), np.eye(3) * 0.01, 1.0, 1.0
        )
    return map


def test_a_map_begins_at_the_first_true_pose_where_the_log_has_one() -> None:
    truth = Pose(3.0, 4.0, 1.0)
    particles = ParticlesInMap().step(context(), ViewMixtures.empty(), truth).belief
    mixture = MixtureInMap().step(context(), ViewMixtures.empty(), truth).belief
    assert particles is not None
    assert mixture is not None
    assert particles.poses.mean(axis=0) == pytest.approx([3, 4, 1], abs=0.002)
    assert particles.poses.std(axis=0) == pytest.approx([0.01, 0.01, np.radians(0.5)], rel=0.1)
    assert mixture.means[0] == pytest.approx([3, 4, 1])


def test_a_map_begins_at_the_origin_where_there_is_no_truth() -> None:
    belief = ParticlesInMap().step(context(), ViewMixtures.empty(), None).belief
    assert belief is not None
    assert belief.poses.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.002)


def test_a_later_log_begins_anywhere_in_the_map_whatever_its_truth_says() -> None:
    particles = ParticlesInMap().step(context(), two_places(), Pose(77.0, 0.0, 0.0)).belief
    mixture = MixtureInMap().step(context(), two_places(), Pose(77.0, 0.0, 0.0)).belief
    assert particles is not None
    assert mixture is not None
    here = np.abs(particles.poses[:, 0]) < 1.0
    there = np.abs(particles.poses[:, 0] - 10.0) < 1.0
    assert (here | there).all()
    assert here.mean() == pytest.approx(0.5, abs=0.05)
    assert np.histogram(particles.poses[:, 2], 4, (-np.pi, np.pi))[0] == pytest.approx(250, abs=50)
    assert mixture.means[0, :2] == pytest.approx([5, 0])
    assert mixture.covariances[0, 0, 0] == pytest.approx(25.01)  # two places 5 m from their mean, and 0.1 m around each
    assert mixture.covariances[0, 2, 2] == pytest.approx(np.pi**2 / 3)
    np.linalg.cholesky(mixture.covariances[0])


def test_a_known_start_is_believed_in_a_later_log_too() -> None:
    belief = ParticlesInMap(at=(1.0, 2.0, 0.5, 0.3, 0.2)).step(context(), two_places(), None).belief
    assert belief is not None
    assert belief.poses.mean(axis=0) == pytest.approx([1, 2, 0.5], abs=0.05)
    assert belief.poses.std(axis=0) == pytest.approx([0.3, 0.3, 0.2], rel=0.1)


def test_asked_for_truth_a_log_without_it_is_an_error() -> None:
    with pytest.raises(BadInput, match="no true pose"):
        ParticlesInMap(at="truth").step(context(), two_places(), None)


def test_there_is_no_belief_to_begin_with_in_the_middle_of_a_log() -> None:
    assert ParticlesInMap().step(context(first=False), two_places(), None).belief is None
    assert MixtureInMap().step(context(first=False), two_places(), None).belief is None
