"""Learns the visual words of a map's references, or of a tour's views."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.visual_words import learned_words, root_descriptors
from omninav.stages.geometry.arrays import Bytes
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent
from omninav.stages.values.own_body import OwnBody, references_without_body
from omninav.stages.values.topological_map import LoopHypotheses
from omninav.stages.values.visual_words import PlaceWords, VisualWords, words_of

DESCRIPTORS_PER_WORD = 16
"""Descriptors that a vocabulary is learned from, for each word."""


class LearnVisualWords(Stage):
    """Learns a vocabulary from the local features of a map's own references, and finds the words of each.

    Words are centres of descriptors by k-means (Sivic & Zisserman 2003), from a sample at even steps along the tour:
    the same tour gives the same words. There are fewer where the references have fewer different descriptors, and none
    where they have no features.
    """

    words: Annotated[int, Bounds(ge=1)] = 2048
    """Size of the vocabulary."""

    class Out(Outputs):
        """The vocabulary, and the words of each reference in the map's order."""

        words: VisualWords

    def step(
        self,
        ctx: Context,
        features: Sequence[LocalFeatures | None],
        events: Sequence[ReferenceEvent | None],
        body: Sequence[OwnBody | None] = (),
    ) -> Out:
        """The whole tour at once; `events`: which of its images became references."""
        views = [
            np.empty((0, 128), np.uint8) if found is None else found.descriptors
            for found in references_without_body(features, events, body)
        ]
        ctx.status("learning visual words")
        made = vocabulary_and_words(views, self.words)
        ctx.fact("visual_words", len(made.centres))
        return self.Out(words=made)


def vocabulary_and_words(views: Sequence[Bytes], words: int) -> VisualWords:
    """A vocabulary of a number of words, learned from the views' own descriptors (N, D), and the words of each view."""
    together = np.concatenate([view for view in views if len(view)] or [np.empty((0, 128), np.uint8)])
    rows = np.linspace(0, max(len(together) - 1, 0), min(len(together), words * DESCRIPTORS_PER_WORD)).astype(np.int64)
    return words_of(views, learned_words(root_descriptors(together[rows]), words))


class LearnPlaceWords(Stage):
    """Learns a vocabulary from all views of a tour, and finds the words of each, for a topological map.

    A place is found again by its views that the map does not keep too: the words of one take a kilobyte.
    """

    words: Annotated[int, Bounds(ge=1)] = 2048
    """Size of the vocabulary."""

    class Out(Outputs):
        words: PlaceWords

    def step(self, ctx: Context, views: ComparedViews, hypotheses: LoopHypotheses) -> Out:
        ctx.status("learning visual words")
        descriptors = [found.descriptors for found in views.features]
        made = vocabulary_and_words(descriptors, self.words)
        return self.Out(words=PlaceWords(made, hypotheses.place, views.poses, views.pose_source))
