import numpy as np
import pytest
from made_words import NOTHING, seen_along

from omninav.pipeline import Context
from omninav.stages.geometry.appearance.visual_words import learned_words, root_descriptors
from omninav.stages.mapping.learned_words import LearnVisualWords, vocabulary_and_words
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent
from omninav.stages.values.visual_words import VisualWords


def learned(views: list[LocalFeatures | None], taken: list[bool] | None = None, **parameters: int) -> VisualWords:
    taken = taken or [True] * len(views)
    events = [ReferenceEvent(n, "far") if each else None for n, each in enumerate(taken)]
    return LearnVisualWords(**parameters).step(Context("words"), views, events).words


def test_a_view_is_most_similar_to_the_references_around_it_whatever_its_heading() -> None:
    views = seen_along(60)
    words = learned(views[::2], words=300)
    for n in range(1, 59, 2):
        turned = views[n].chosen(np.roll(np.arange(len(views[n])), 13))
        assert abs(words.similarities(turned.descriptors).argmax() - n / 2) <= 2


def test_only_images_that_became_references_have_words() -> None:
    views = seen_along(12)
    some = learned(views, [n % 3 == 0 for n in range(12)], words=100)
    assert len(some) == 4
    assert int(np.argmax(some.similarities(views[9].descriptors))) == 3


def test_a_map_of_black_images_has_no_words_and_resembles_nothing() -> None:
    words = learned([NOTHING, None, NOTHING])
    assert words.centres.shape == (0, 128)
    assert words.similarities(seen_along(1)[0].descriptors).tolist() == [0.0, 0.0, 0.0]


def test_a_black_image_among_others_has_no_words() -> None:
    views = [*seen_along(5), NOTHING]
    words = learned(views, words=1000)  # more than there are descriptors
    assert len(words.centres) <= 200
    assert words.similarities(views[0].descriptors)[5] == 0.0
    assert not words.similarities(NOTHING.descriptors).any()


def test_a_map_of_one_image_knows_it() -> None:
    view = seen_along(1)[0]
    assert learned([view]).similarities(view.descriptors) == pytest.approx([1.0], abs=1e-5)
    assert len(learned([])) == 0


def test_a_vocabulary_is_learned_from_descriptors_at_even_steps_from_the_first_to_the_last(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("omninav.stages.mapping.learned_words.DESCRIPTORS_PER_WORD", 3)
    looks = np.random.default_rng(0).integers(0, 200, (5, 128)).astype(np.uint8)
    made = vocabulary_and_words([looks[:2], looks[:0], looks[2:]], 1)
    np.testing.assert_array_equal(made.centres, learned_words(root_descriptors(looks[[0, 2, 4]]), 1))
