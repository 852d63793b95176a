"""The visual words of a map's views."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, RowsOf, Shape, Starts, Value
from omninav.stages.geometry.appearance import visual_words
from omninav.stages.geometry.arrays import Array, Bytes, Floats, Ints
from omninav.stages.geometry.runs import chosen_runs

from .pose import PoseSource

MIN_SIMILARITY = 0.01
"""Similarity assigned to references without a common word, above 0 so that they stay candidates."""


class VisualWords(Value):
    """A vocabulary of local features, and which of its words each view of a map holds.

    `centres` (K, D): descriptors, as `root_descriptors` makes them, that represent one word each. `rarity` (K,): what a
    word weighs. Of view v the words are rows `starts[v]` to `starts[v + 1]` of `words` (W,), ascending, and their
    weights (W,), which have length 1 together.
    """

    costly: ClassVar[bool] = True

    centres: Annotated[Floats, Shape("K", "D")]
    rarity: Annotated[Floats, Shape("K"), Bounds(ge=0)]
    starts: Annotated[Ints, Shape("V+1"), Starts("W")]
    words: Annotated[npt.NDArray[np.int32], Shape("W"), RowsOf("K")]
    weights: Annotated[Floats, Shape("W"), Bounds(ge=0, le=1.001)]

    def __len__(self) -> int:
        return len(self.starts) - 1

    def similarities(self, descriptors: Bytes) -> Floats:
        """The cosine (V,) in [0, 1] of the angle between a view's words and those of each view of the map.

        `descriptors` (N, D): of the view's local features. 0 for all where it has none.
        """
        words, counts = visual_words.word_counts(visual_words.root_descriptors(descriptors), self.centres)
        weights = visual_words.weighted(words, counts, self.rarity)
        return np.clip(np.asarray(self._views_of_words[words].T @ weights, np.float32), 0.0, 1.0)

    @cached_property
    def _views_of_words(self) -> Any:
        """Weights by word and view: a view shares a few hundred of some thousand words, so that most are not read."""
        from scipy.sparse import csr_matrix  # slow to import, and not needed without words

        rows = csr_matrix((self.weights, self.words, self.starts), shape=(len(self), len(self.centres)))
        return rows.T.tocsr()

    def of_views(self, rows: Ints) -> "VisualWords":
        """The words of some views (N,) in this order, of the same vocabulary; one past the last view has none."""
        taken, starts = chosen_runs(self.starts, rows)
        return replace(self, starts=starts, words=self.words[taken], weights=self.weights[taken])


def words_of(views: Sequence[Bytes], centres: Floats) -> VisualWords:
    """The words of a map's views, each given by its descriptors (N, D), with a vocabulary that was learned."""
    return words_of_roots((visual_words.root_descriptors(each) for each in views), centres)


def words_of_roots(views: Iterable[Floats], centres: Floats) -> VisualWords:
    """The same of descriptors as `root_descriptors` makes them."""
    found = [visual_words.word_counts(each, centres) for each in views]
    words = np.concatenate([np.empty(0, np.int64), *(each for each, _ in found)])
    rarity = visual_words.rarity(np.bincount(words, minlength=len(centres)), len(found))
    weights = [visual_words.weighted(*each, rarity) for each in found]
    return VisualWords(
        centres,
        rarity,
        np.cumsum([0, *(len(each) for each in weights)], dtype=np.int64),
        words.astype(np.int32),
        np.concatenate([np.empty(0, np.float32), *weights]),
    )


class WordSimilarities(Value):
    """Similarity of the present view to each view of a map by their visual words: `values` (V,) float32 in [0, 1]."""

    values: Annotated[Floats, Shape("V"), Bounds(ge=0, le=1)]

    def factors(self, references: int, chosen: Ints | None, power: float) -> Floats:
        """Factors (N,) in (0, 1] of the `chosen` ones of a map's so many references; None: of all.

        `values` to a power. Those of references that a map has learned since are as the best, and all are 1 for a view
        without words: nothing is known of them.
        """
        best = float(self.values.max(initial=0.0))
        if best == 0.0:
            return np.ones(references if chosen is None else len(chosen), np.float32)
        each = np.full(references, best, np.float32)
        each[: len(self.values)] = np.maximum(self.values, MIN_SIMILARITY)
        return np.asarray((each if chosen is None else each[chosen]) ** np.float32(power), np.float32)


class PlaceWords(Value):
    """The visual words of all views of a tour, and the place of a topological map that each belongs to.

    `words`: of each view, also of those that the map does not keep; `owner` (V,): its place. `poses` (V, 3): x, y (m),
    heading (rad) where it was taken, from `pose_source`: for scoring only.
    """

    words: Annotated[VisualWords, Shape("V")]
    owner: Annotated[Ints, Shape("V"), Bounds(ge=0)]
    poses: Annotated[Array, Shape("V", 3)]
    pose_source: PoseSource

    def __len__(self) -> int:
        """Number of places."""
        return int(self.owner.max(initial=-1)) + 1
