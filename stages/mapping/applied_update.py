"""What a lesson did to a map, kept so that it can be undone."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.view_mixtures import ViewMixtures

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


class AppliedUpdate(Value):
    """The lesson of tick `index`: its state was taken in by the views `names` (J,), turned by `turns` (J,) rad against
    it and `alike` (J,), S in (0, 1]. What they held before: components (C,) as in `ViewMixtures`, `owner` in [0, J).
    """

    index: int
    state: GaussianMixture
    names: Ints
    turns: Array
    alike: Array
    owner: Ints
    means: Array
    covariances: Array
    weights: Array
    counts: Array

    def rows(self, map: ViewMixtures) -> Ints:
        """Where the views stand in the map (J,)."""
        return np.searchsorted(map.names, self.names)

    def places(self) -> Iterator[tuple[Array, Array, Array, Array]]:
        """Of each view, what it held before: means, covariances, weights, counts."""
        for row in range(len(self.names)):
            mine = self.owner == row
            yield self.means[mine], self.covariances[mine], self.weights[mine], self.counts[mine]

    def undo(self, map: ViewMixtures) -> None:
        """Give the views back what they held before. A view that came with the lesson stays, without any place."""
        rows = self.rows(map)
        map.keep_components(~np.isin(map.owner, rows))
        map.put_mixtures(rows[self.owner], self.means, self.covariances, self.weights, self.counts)

    def within(self, map: ViewMixtures) -> "AppliedUpdate":
        """What it did to those views that the map still has."""
        kept = np.isin(self.names, map.names)
        mine, row = kept[self.owner], np.cumsum(kept) - 1
        held = (self.means[mine], self.covariances[mine], self.weights[mine], self.counts[mine])
        views = (self.names[kept], self.turns[kept], self.alike[kept])
        return AppliedUpdate(self.index, self.state, *views, row[self.owner[mine]], *held)


def taught_by(
    state: GaussianMixture, index: int, names: Ints, turns: Array, alike: Array, map: ViewMixtures
) -> AppliedUpdate:
    """What a lesson is about to do to the views `names` of the map: what they hold now is kept."""
    chosen = np.flatnonzero(np.isin(map.names[map.owner], names))
    owner = np.searchsorted(names, map.names[map.owner[chosen]])
    held = (getattr(map, field)[chosen] for field in ("means", "covariances", "weights", "counts"))
    return AppliedUpdate(index, state, names, turns, alike, owner, *held)
