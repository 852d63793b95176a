import numpy as np
import pytest
from made_beliefs import scattered_around
from made_references import references
from made_words import NOTHING, features_of, seen_along

from omninav.pipeline import Context, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.candidates.around_belief import AroundBelief
from omninav.stages.candidates.words import WordCandidates
from omninav.stages.mapping.learned_words import vocabulary_and_words
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.maps import ReferenceGraph

VIEWS = seen_along(300)
WORDS = vocabulary_and_words([view.descriptors for view in VIEWS], 400)


@pytest.fixture(autouse=True)
def few_references(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.stages.candidates.words.WORD_REFERENCES", 20)
    monkeypatch.setattr("omninav.stages.candidates.around_belief.BACKGROUND_REFERENCES", 50)


def a_map(number: int = 300) -> ReferenceGraph:
    poses = np.column_stack([0.25 * np.arange(number), np.zeros((number, 2))])
    return references(poses, np.ones((number, 4, 4), np.float32))


def output(view=VIEWS[100], near: Particles | None = None, number: int = 300, **kw):
    stage, ctx = WordCandidates(**{"compare_all_up_to": 0, **kw}), Context("candidates")
    ctx.tick = Tick(index=1, stamp=0)
    stage.setup(ctx)
    return stage.step(ctx, view, a_map(number), WORDS, near)


def chosen(candidates: Candidates) -> set[int]:
    assert candidates.references is not None
    assert candidates.sampling_weight is not None
    return set(candidates.references[candidates.sampling_weight == 1.0].tolist())


def particles_at(x: float) -> Particles:
    return scattered_around((x, 0, 0), (0.05, 0.05, 0.1), 50)


def test_references_that_share_words_are_found_without_a_belief() -> None:
    found = chosen(output().candidates)
    assert set(range(96, 105)) <= found
    assert len(found) == 20


def test_a_kidnapped_robot_is_found_and_the_belief_looked_after() -> None:
    near = particles_at(60.0)
    some = AroundBelief()
    some.setup(Context("candidates"))
    around = some.around(a_map(), near, None)
    found = chosen(output(near=near).candidates)
    assert set(around.tolist()) | {99, 100, 101} <= found


def test_others_represent_the_rest_of_the_map() -> None:
    weights = output().candidates.sampling_weight
    assert weights.sum() == pytest.approx(300)


def test_small_maps_are_compared_whole_and_similarities_are_given_all_the_same() -> None:
    out = output(compare_all_up_to=300)
    assert out.candidates.references is None
    assert int(out.word_similarities.values.argmax()) == 100


def test_an_image_without_features_is_looked_for_near_the_belief() -> None:
    assert output(NOTHING).candidates.references is None
    near = particles_at(60.0)
    assert len(chosen(output(NOTHING, near).candidates)) < 60


def test_references_learned_since_are_compared_in_any_case() -> None:
    assert {300, 301, 302} <= chosen(output(number=303).candidates)


def test_words_of_another_map_are_refused() -> None:
    with pytest.raises(BadInput, match="words of 300 references with a map of 250"):
        output(number=250)
    with pytest.raises(BadInput, match="descriptors of 128 numbers, the view's are of 64"):
        output(features_of(np.ones((3, 64), np.uint8)))
