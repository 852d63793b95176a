"""Compares the words of the present view with those of a topological map's places."""

import numpy as np

from omninav.pipeline import BadInput, Context, Outputs, Stage
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.similarity import RetrievedReferences
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_words import PlaceWords, WordSimilarities

ANSWERS = 10
"""Views that are named for each image."""


class MatchPlaceWords(Stage):
    """Similarity of the present view's visual words to those of each place's most similar view.

    Of all views of the tour, not of medoids alone: so a view near the end of a long place is known too. Raises BadInput
    where the words are of another map.
    """

    class Out(Outputs):
        """Similarities by place, and the most similar views of the tour; absent where the map has no words."""

        similarities: WordSimilarities | None = None
        answers: RetrievedReferences | None = None

    def step(self, ctx: Context, features: LocalFeatures, map: TopologicalMap, words: PlaceWords | None = None) -> Out:
        if words is None:
            return self.Out()
        if len(words) != len(map):
            raise BadInput(
                f"words: they are of {len(words)} places, the map has {len(map)}; give those that were saved with it"
            )
        each = words.words.similarities(features.descriptors)
        best = np.zeros(len(map), np.float32)
        np.maximum.at(best, words.owner, each)
        order = np.argsort(-each, kind="stable")[:ANSWERS]
        answers = RetrievedReferences(order, each[order], np.zeros(len(order)))
        return self.Out(similarities=WordSimilarities(best), answers=answers)
