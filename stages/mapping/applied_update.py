"""An update applied to a map, kept so that it can be undone."""

from collections.abc import Iterator

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.view_mixtures import ViewMixtures


class AppliedUpdate(Value):
    """The update of tick `index`: its state was added to the views `ids` (J,), turned by `turns` (J,) rad against it
    and with `similarities` (J,) in (0, 1]. Their components before (C,) as in `ViewMixtures`, `owner` in [0, J).
    """

    index: int
    state: GaussianMixture
    ids: Ints
    turns: Array
    similarities: Array
    owner: Ints
    means: Array
    covariances: Array
    weights: Array
    counts: Array

    def rows(self, map: ViewMixtures) -> Ints:
        """Rows of the views in the map (J,)."""
        return np.searchsorted(map.ids, self.ids)

    def places(self) -> Iterator[tuple[Array, Array, Array, Array]]:
        """For each view its components before: means, covariances, weights, counts."""
        for row in range(len(self.ids)):
            mine = self.owner == row
            yield self.means[mine], self.covariances[mine], self.weights[mine], self.counts[mine]

    def undo(self, map: ViewMixtures) -> None:
        """Restore the views' earlier components. A view inserted by the update stays, without components."""
        rows = self.rows(map)
        map.keep_components(~np.isin(map.owner, rows))
        map.put_mixtures(rows[self.owner], self.means, self.covariances, self.weights, self.counts)

    def within(self, map: ViewMixtures) -> "AppliedUpdate":
        """The same update, of those views only that the map still has."""
        kept = np.isin(self.ids, map.ids)
        mine, row = kept[self.owner], np.cumsum(kept) - 1
        held = (self.means[mine], self.covariances[mine], self.weights[mine], self.counts[mine])
        views = (self.ids[kept], self.turns[kept], self.similarities[kept])
        return AppliedUpdate(self.index, self.state, *views, row[self.owner[mine]], *held)


def record_update(
    state: GaussianMixture, index: int, ids: Ints, turns: Array, similarities: Array, map: ViewMixtures
) -> AppliedUpdate:
    """Record the components of the views `ids` before an update."""
    chosen = np.flatnonzero(np.isin(map.ids[map.owner], ids))
    owner = np.searchsorted(ids, map.ids[map.owner[chosen]])
    held = (getattr(map, field)[chosen] for field in ("means", "covariances", "weights", "counts"))
    return AppliedUpdate(index, state, ids, turns, similarities, owner, *held)
