import numpy as np
import pytest
from made_ticks import at_tick
from made_view_maps import learned

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.fusion.growing_prior import MixtureInMap, ParticlesInMap
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import ViewMixtures

MODULE = "omninav.stages.fusion.growing_prior"


def two_places() -> ViewMixtures:
    return learned(10.0, 10.0, weights=1.0, map=learned(0.0, 0.0, weights=1.0))


PRIORS = [ParticlesInMap, MixtureInMap]


def moments_of(
    stage: ParticlesInMap | MixtureInMap, map: ViewMixtures, truth: Pose | None = None, **ports: Reinitialise
):
    """Mean and standard deviations of the first belief, headings around 0."""
    belief = stage.step(at_tick(first=not ports), map, truth, **ports).belief
    assert belief is not None
    if isinstance(stage, ParticlesInMap):
        assert belief.weights == pytest.approx(np.full(stage.number, 1.0 / stage.number))
        return belief.poses.mean(axis=0), belief.poses.std(axis=0)
    assert belief.weights.tolist() == [1.0]
    return belief.means[0], np.sqrt(np.diagonal(belief.covariances[0]))


TRUTH = Pose(3.0, 4.0, 1.0)


@pytest.mark.parametrize("prior", PRIORS)
@pytest.mark.parametrize(
    ("options", "truth", "place"),
    [
        ({}, TRUTH, [3, 4, 1]),
        ({}, None, [0, 0, 0]),
        ({"at": "truth"}, TRUTH, [3, 4, 1]),
        ({"at": "origin"}, TRUTH, [0, 0, 0]),
    ],
)
def test_a_map_begins_at_the_first_true_pose_where_the_log_has_one_or_at_the_origin(
    prior: type, options: dict[str, str], truth: Pose | None, place: list[int]
) -> None:
    mean, spread = moments_of(prior(**options), ViewMixtures.empty(), truth)
    assert mean == pytest.approx(place, abs=0.002)
    assert spread == pytest.approx([0.01, 0.01, np.radians(0.5)], rel=0.1)
    if options:  # a start in a map is less certain than one that begins it
        mean, spread = moments_of(prior(**options), two_places(), truth)
        assert mean == pytest.approx(place, abs=0.02)
        assert spread == pytest.approx([0.1, 0.1, 0.1], rel=0.1)


def test_a_later_log_begins_anywhere_in_the_map_whatever_its_truth_says() -> None:
    particles = ParticlesInMap().step(at_tick(first=True), two_places(), Pose(77.0, 0.0, 0.0)).belief
    mixture = MixtureInMap().step(at_tick(first=True), two_places(), Pose(77.0, 0.0, 0.0)).belief
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


def test_asked_for_truth_a_log_without_it_is_an_error() -> None:
    with pytest.raises(BadInput, match="no true pose"):
        ParticlesInMap(at="truth").step(at_tick(first=True), two_places(), None)


def test_there_is_no_belief_to_begin_with_in_the_middle_of_a_log() -> None:
    assert ParticlesInMap().step(at_tick(), two_places(), None).belief is None
    assert MixtureInMap().step(at_tick(), two_places(), None).belief is None


@pytest.mark.parametrize("prior", PRIORS)
def test_who_asks_to_start_again_says_where_or_means_anywhere_in_the_map(prior: type) -> None:
    mean, spread = moments_of(prior(at="origin"), two_places(), restart=Reinitialise((6.0, 7.0, -1.0, 0.3, 0.2)))
    assert mean == pytest.approx([6.0, 7.0, -1.0], abs=0.05)
    assert spread == pytest.approx([0.3, 0.3, 0.2], rel=0.1)
    mean, spread = moments_of(prior(at="origin"), two_places(), restart=Reinitialise())
    assert mean[:2] == pytest.approx([5.0, 0.0], abs=0.5)
    assert spread == pytest.approx([25.01**0.5, 0.1, np.pi / 3**0.5], rel=0.1)


def test_a_start_that_is_stated_as_exact_has_a_covariance_all_the_same() -> None:
    for ports in ({}, {"restart": Reinitialise((1.0, 2.0, 0.5, 0.0, 0.0))}):  # as a message whose covariance is not set
        _, spread = moments_of(MixtureInMap(at=(1.0, 2.0, 0.5, 0.1, 0.0)), ViewMixtures.empty(), **ports)
        assert spread == pytest.approx([0.01 if ports else 0.1] * 2 + [np.radians(0.5)])


@pytest.mark.parametrize("prior", PRIORS)
def test_headings_of_a_start_are_within_half_a_turn(prior: type) -> None:
    belief = prior(at=(0.0, 0.0, 4.0, 0.1, 0.1)).step(at_tick(first=True), ViewMixtures.empty(), None).belief
    assert belief is not None
    pose = belief.estimate().pose
    assert pose.heading == pytest.approx(4.0 - 2 * np.pi, abs=0.01)


def test_an_unknown_start_in_a_map_of_one_place_is_no_narrower_than_a_known_one_and_turns_any_way(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(f"{MODULE}.INITIAL_SIGMA_M", 0.2)
    map = ViewMixtures.empty()
    row = map.add_view(np.zeros(1, np.float32), "Coefficients")
    bent = np.diag([1e-6, 4e-6, 1e-6])
    bent[0, 2] = bent[2, 0] = bent[1, 2] = bent[2, 1] = 5e-7
    map.add_component(row, np.array([1.0, 2.0, 3.0]), bent, 0.5, 1.0)
    belief = MixtureInMap().step(at_tick(first=True), map, None).belief
    assert belief is not None
    covariance = belief.covariances[0]
    assert covariance[:2, :2] == pytest.approx(np.eye(2) * 0.04)
    assert covariance[2] == pytest.approx([0.0, 0.0, np.pi**2 / 3.0])
    np.testing.assert_array_equal(covariance, covariance.T)
    assert belief.means[0, :2] == pytest.approx([1.0, 2.0])
