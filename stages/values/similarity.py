"""Similarities of the current view to the views of the map."""

from functools import cached_property
from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.probability.evidence import best_headings, centre_and_spread


class Similarities(Value):
    """Similarity of the current view to references at headings. `values`: (references, headings) float32 in [0, 1].

    Column h is for a robot whose heading is the reference view's own heading turned counter-clockwise by
    2 pi h / headings. `candidates` (references,) holds the indices of the map's references that were compared, in
    ascending order; None means all of them. `sampling_weight` (references,): how many references of the map each
    compared one represents, where only a sample was compared; None: one each. Sums weighted by it are unbiased
    estimates for the whole map.

    `exponent` and `colour_scale` say how views of n segments were compared, so that other stages can do the same:

    * with both, or of histograms with `exponent` alone: S = max_k (sum of the k largest s_j) k^-exponent
      n^-(1-exponent), where s_j is the intersection of histograms, and of other features 1 - |difference| /
      `colour_scale`, not below 0;
    * `colour_scale` alone: S = 1 - |difference of the whole views| / `colour_scale`;
    * neither: otherwise, as no other stage can.

    `last_view`: similarity to the view before, at the best heading; None at the first, and where it is not requested.
    """

    values: Annotated[Floats, Shape("references", "headings"), Bounds(ge=0, le=1)]
    candidates: Annotated[Ints | None, Shape("references"), Bounds(ge=0)] = None
    sampling_weight: Annotated[Array | None, Shape("references"), Bounds(gt=0)] = None
    exponent: float | None = None
    colour_scale: float | None = None
    last_view: Annotated[float | None, Bounds(ge=0, le=1)] = None

    @cached_property
    def best(self) -> Floats:
        """Each reference's similarity at its best heading: (references,). Not to be changed: others read it too."""
        return self._at_best_headings[0]

    @cached_property
    def best_heading(self) -> Ints:
        """The column of each reference's best heading, of equal ones the first: (references,)."""
        return self._at_best_headings[1]

    @cached_property
    def spread(self) -> float:
        """Standard deviation of `best` over the map."""
        return centre_and_spread(self.best, self.sampling_weight)[1]

    @cached_property
    def _at_best_headings(self) -> tuple[Floats, Ints]:
        return best_headings(self.values)


class SimilarityField(Value):
    """Weights (max(S, floor) / top)^power over the compared references and headings, prepared for drawing.

    `values`, `candidates`: as in `Similarities`. `floor`: the similarity below which all cells weigh the same. `above`
    (A,): flat indices of the cells above it, `weights` (A,): their cumulative weights, and `excess` (A,): the same of
    what each weighs more than one at the floor. `floor_cells` (references,): cumulative number of cells at the floor,
    by sampling weight; `floor_weight`: what they weigh in all. `mean`: mean weight over the map.
    """

    values: Annotated[Floats, Shape("references", "headings"), Bounds(ge=0, le=1)]
    candidates: Annotated[Ints | None, Shape("references"), Bounds(ge=0)]
    floor: Annotated[float, Bounds(ge=0)]
    above: Annotated[Ints, Shape("A"), Bounds(ge=0)]
    weights: Annotated[Array, Shape("A"), Bounds(ge=0)]
    excess: Annotated[Array, Shape("A"), Bounds(ge=0)]
    floor_cells: Annotated[Array, Shape("references"), Bounds(ge=0)]
    floor_weight: Annotated[float, Bounds(ge=0)]
    mean: Annotated[float, Bounds(ge=0)]


class RetrievedReferences(Value):
    """The references of a map that are most similar to the current view, the most similar first.

    `references` (k,): their indices in the map. `similarities` (k,) in [0, 1] and `turns` (k,): each at its best
    heading, and how far the robot is then turned from the reference's own (radians, counter-clockwise).
    """

    references: Annotated[Ints, Shape("k"), Bounds(ge=0)]
    similarities: Annotated[Floats, Shape("k"), Bounds(ge=0, le=1)]
    turns: Annotated[Array, Shape("k")]


class BestMatch(Value):
    """The part of a map that looks most like the current view.

    `reference`: its number in the map; of a map that forgets views the view's lasting number, of a topological map the
    place. `turn`: how far the robot is turned against it (radians, counter-clockwise). `similarity` in [0, 1], 1 is
    equal; `distance` in the unit of the comparison, 0 is equal; each None where the comparison does not give it.
    """

    reference: Annotated[int, Bounds(ge=0)]
    turn: float
    similarity: Annotated[float | None, Bounds(ge=0, le=1)] = None
    distance: Annotated[float | None, Bounds(ge=0)] = None
