"""Which part of the map looks most like the present image."""

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.similarity import BestMatch, Similarities
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours
from omninav.stages.values.visual_distance import VisualDistances


class BestReference(Stage):
    """Finds the reference, view or place of the map that looks most like the present image.

    Of equal ones the first in the map's order. Nothing of it is used for localisation: it is there to be looked at.
    """

    class Out(Outputs):
        """`best_match`: absent where the image resembles nothing in the map."""

        best_match: BestMatch | None = None

    def step(
        self, ctx: Context, match: Similarities | Neighbours | VisualDistances, map: ViewMixtures | None = None
    ) -> Out:
        """One image. `map`: the one that was searched, where its views come and go."""
        if isinstance(match, VisualDistances):
            return self.Out(best_match=nearest_place(match))
        return self.Out(best_match=nearest_view(match, map) if isinstance(match, Neighbours) else peak_of(match))


def peak_of(similarities: Similarities) -> BestMatch | None:
    """The most similar reference at its best heading; None where none was compared."""
    values, candidates = similarities.values, similarities.candidates
    if not values.size:
        return None
    row, heading = divmod(int(values.argmax()), values.shape[1])
    reference = row if candidates is None else int(candidates[row])
    turned = np.exp(2j * np.pi * heading / values.shape[1])
    turn = float(np.arctan2(turned.imag, turned.real))
    return BestMatch(reference, turn, similarity=float(values[row, heading]))


def nearest_view(neighbours: Neighbours, map: ViewMixtures | None) -> BestMatch | None:
    """The nearest view of a map that grows and forgets, by its lasting number where the map is given."""
    if not len(neighbours.rows):
        return None
    row, similarity = int(neighbours.rows[0]), float(neighbours.similarities[0])
    reference = row if map is None else int(map.ids[row])
    return BestMatch(reference, float(neighbours.turns[0]), similarity, float(neighbours.distances[0]))


def nearest_place(distances: VisualDistances) -> BestMatch | None:
    """The place whose view is least different; None where all have nothing in common with the image."""
    if not np.isfinite(distances.distances).any():
        return None
    place = int(distances.distances.argmin())
    return BestMatch(place, float(distances.turns[place]), distance=float(distances.distances[place]))
