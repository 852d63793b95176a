"""Selects the references that hold the same visual words as the view, and those near the belief."""

import numpy as np

from omninav.pipeline import BadInput, Context, Stage
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.values.belief import Particles
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords, WordSimilarities

from .around_belief import AroundBelief

WORD_REFERENCES = 100
"""References that are compared because they share most words with the view."""


class WordCandidates(AroundBelief, Stage):
    """Selects the references that share most visual words with the view, anywhere in the map and at any heading.

    Words are of local features (`local_features`), weighed by how rare they are in the map (Sivic & Zisserman 2003), so
    they find what colours in another light do not. References near a belief are compared too.
    Small maps are compared whole. References that a map has learned since its words were are compared in any case.
    """

    class Out(AroundBelief.Out):
        """The references to compare with the view, and how similar all are by their words."""

        word_similarities: WordSimilarities

    def step(
        self,
        ctx: Context,
        features: LocalFeatures,
        map: ReferenceGraph,
        words: VisualWords,
        near: Particles | None = None,
        length_scale: LengthScale | None = None,
    ) -> Out:
        if len(words) > len(map):
            raise BadInput(
                f"candidates: words of {len(words)} references with a map of {len(map)}; "
                "give the words that were saved with the map"
            )
        if len(features) and len(words.centres) and features.descriptors.shape[1] != words.centres.shape[1]:
            raise BadInput(
                f"candidates: words of descriptors of {words.centres.shape[1]} numbers, the view's are of "
                f"{features.descriptors.shape[1]}; learn the words again with these features"
            )
        similar = words.similarities(features.descriptors)
        out = WordSimilarities(similar)
        if len(map) <= self.compare_all_up_to:
            return self.Out(candidates=Candidates(), word_similarities=out)
        best = np.argsort(-similar, kind="stable")[: WORD_REFERENCES if similar.any() else 0]
        around, since = self.around(map, near, length_scale), np.arange(len(words), len(map))
        chosen = distinct(np.concatenate([best, around, since]))
        return self.Out(candidates=self.with_others(chosen, map), word_similarities=out)
