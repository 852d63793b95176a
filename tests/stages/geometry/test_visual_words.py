import numpy as np
import pytest

from omninav.stages.geometry.appearance.visual_words import (
    learned_words,
    rarity,
    root_descriptors,
    weighted,
    word_counts,
)


def clouds(groups: int, each: int) -> tuple[np.ndarray, np.ndarray]:
    """Descriptors around so many different ones."""
    rng = np.random.default_rng(0)
    middles = rng.integers(0, 200, (groups, 128))
    group = np.arange(groups * each) // each
    return (middles[group] + rng.integers(0, 10, (len(group), 128))).astype(np.uint8), group


def test_root_descriptors_have_length_1_and_compare_as_hellinger_does() -> None:
    one, other = np.random.default_rng(1).integers(1, 255, (2, 128)).astype(np.uint8)
    rows = root_descriptors(np.stack([one, other, np.zeros(128, np.uint8)]))
    assert np.linalg.norm(rows, axis=1) == pytest.approx([1.0, 1.0, 0.0])
    assert rows[0] @ rows[1] == pytest.approx(np.sqrt(one / one.sum() * (other / other.sum())).sum(), rel=1e-5)


def test_descriptors_of_one_kind_become_one_word() -> None:
    descriptors, group = clouds(20, 30)
    rows = root_descriptors(descriptors)
    centres = learned_words(rows, 20)
    words = [word_counts(rows[n : n + 1], centres)[0][0] for n in range(len(rows))]
    pairs = set(zip(words, group.tolist(), strict=True))
    assert len(centres) == 20
    assert len(pairs) == len(set(words)) == 20


def test_there_are_no_more_words_than_different_descriptors() -> None:
    rows = root_descriptors(np.repeat(clouds(3, 1)[0], 4, axis=0))
    assert len(learned_words(rows, 50)) == 3
    assert learned_words(rows[:0], 50).shape == (0, 128)
    assert learned_words(rows, 50).tobytes() == learned_words(rows, 50).tobytes()


def test_words_are_counted_and_weigh_the_more_the_rarer_they_are() -> None:
    centres = root_descriptors(clouds(4, 1)[0])
    words, counts = word_counts(centres[[2, 0, 2]], centres)
    assert words.tolist() == [0, 2]
    assert counts.tolist() == [1.0, 2.0]
    weights = rarity(np.array([10, 0, 1, 0]), 10)
    assert weights == pytest.approx([np.log(2.0), 0.0, np.log(11.0), 0.0])
    one, two = weighted(words, counts, weights)
    assert one**2 + two**2 == pytest.approx(1.0)
    assert two / one == pytest.approx(np.sqrt(2.0) * np.log(11.0) / np.log(2.0))


def test_a_view_without_descriptors_has_no_words() -> None:
    centres = root_descriptors(clouds(4, 1)[0])
    for words, counts in (word_counts(centres[:0], centres), word_counts(centres, centres[:0])):
        assert len(words) == len(counts) == len(weighted(words, counts, np.zeros(4, np.float32))) == 0
