import numpy as np
import pytest
from made_beliefs import even, scattered_around
from made_references import references

from omninav.pipeline import Context
from omninav.stages.candidates.around_belief import AroundBelief
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph


def a_map(number: int = 400, spacing: float = 0.1) -> ReferenceGraph:
    rng = np.random.default_rng(0)
    poses = np.column_stack([spacing * np.arange(number), np.zeros(number), rng.uniform(-3, 3, number)])
    return references(poses)


def particles_at(x: float) -> Particles:
    return scattered_around((x, 0.0, 0.0), (0.05, 0.05, 0.1), 50)


def gaps_to(map: ReferenceGraph, belief: Particles) -> np.ndarray:
    return np.hypot(*(map.poses[:, None, :2] - belief.poses[:, :2]).transpose(2, 0, 1)).min(axis=1)


def near(
    map: ReferenceGraph, belief: Particles | None, radius: float, recovery: float = 0.0, background: int = 20
) -> Candidates:
    some = AroundBelief(radius=radius / 2.0, recovery_radius=recovery / 2.0)
    some.setup(Context("candidates"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("omninav.stages.candidates.around_belief.BACKGROUND_REFERENCES", background)
        return some.with_others(some.around(map, belief, LengthScale(2.0)), map)


def chosen(candidates: Candidates) -> tuple[np.ndarray, np.ndarray]:
    assert candidates.references is not None
    assert candidates.sampling_weight is not None
    return candidates.references, candidates.sampling_weight


@pytest.mark.parametrize("radius", [0.4, 1.0, 3.0])
def test_near_a_belief_every_reference_within_the_radius_is_compared_for_itself(radius: float) -> None:
    map, belief = a_map(), particles_at(8.0)
    references, weight = chosen(near(map, belief, radius))
    gap = gaps_to(map, belief)
    inside = np.flatnonzero(gap <= radius)
    assert set(inside) <= set(references)
    assert (weight[np.isin(references, inside)] == 1).all()
    assert (gap[references] > 1.36 * radius).sum() <= 20
    assert (np.diff(references) > 0).all()


@pytest.mark.parametrize("seed", range(5))
def test_references_scattered_over_the_plane_are_found_by_their_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    map = a_map(3000)
    map.poses[:, :2] = rng.normal(0, 30, (3000, 2))
    belief = even(rng.normal(0, (20, 20, 0), (40, 3)))
    references, _ = chosen(near(map, belief, 2.0, background=0))
    gap = gaps_to(map, belief)
    assert set(np.flatnonzero(gap <= 2.0)) <= set(references)
    assert gap[references].max() <= 1.36 * 2.0


def test_around_recovery_particles_only_the_nearest_references_are_compared() -> None:
    map, tracked, hypotheses = a_map(), particles_at(8.0), particles_at(30.0)
    poses = np.concatenate([tracked.poses, hypotheses.poses])
    belief = Particles(poses, np.full(100, 0.01), recovery_particles=50)
    references, weight = chosen(near(map, belief, 3.0, 0.5, background=0))
    inside = (gaps_to(map, tracked) <= 3.0) | (gaps_to(map, hypotheses) <= 0.5)
    assert set(np.flatnonzero(inside)) <= set(references)
    farther = (gaps_to(map, tracked) <= 1.36 * 3.0) | (gaps_to(map, hypotheses) <= 1.36 * 0.5)
    assert set(references) <= set(np.flatnonzero(farther))
    assert (weight == 1).all()
    alone, _ = chosen(near(map, belief, 3.0, 0.0, background=0))
    without, _ = chosen(near(map, tracked, 3.0, 0.5, background=0))
    assert set(alone) == set(without)


@pytest.mark.parametrize("x", [5.0, 20.0, 33.0])
def test_background_references_represent_the_whole_map(x: float) -> None:
    map, value = a_map(), np.cos(np.arange(400) / 60.0) + 2.0
    references, weight = chosen(near(map, particles_at(x), 1.0, background=60))
    assert weight.sum() == pytest.approx(400)
    assert (value[references] * weight).sum() == pytest.approx(value.sum(), rel=0.02)


def test_others_are_at_even_steps_and_stand_for_all_that_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.candidates.around_belief.BACKGROUND_REFERENCES", 3)
    references, weight = chosen(AroundBelief().with_others(np.array([4, 5]), a_map(9)))
    assert references.tolist() == [0, 4, 5, 8]  # 0, 4 and 8, of which 4 is chosen itself
    assert weight.tolist() == [3.5, 1.0, 1.0, 3.5]
    assert AroundBelief().with_others(np.array([4, 5]), a_map(5)).references is None


def test_all_are_compared_where_none_is_near_and_without_a_belief() -> None:
    assert near(a_map(), particles_at(500.0), 2.0).references is None
    assert near(a_map(), None, 2.0).references is None


def test_the_radius_is_in_length_scales_of_the_map() -> None:
    map, belief = a_map(800), particles_at(30.0)
    compared = []
    for metres in (0.1, 0.5, 2.0):
        some = AroundBelief()
        some.setup(Context("candidates"))
        references = some.around(map, belief, LengthScale(metres))
        assert set(np.flatnonzero(gaps_to(map, belief) <= 4.5 * metres)) <= set(references)
        compared.append(len(references))
    assert compared[0] < 40 < compared[1] < 130 < compared[2]


def test_references_added_to_a_map_are_found() -> None:
    map, belief = a_map(), particles_at(8.0)
    some = AroundBelief(radius=2.0)
    some.setup(Context("candidates"))
    before = some.around(map, belief, None)
    map.append("poses", np.array([8.0, 0.5, 0.0]))
    assert set(some.around(map, belief, None)) - set(before) == {400}
