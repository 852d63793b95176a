"""Distance that an update moves a place in the map, by the number of updates before."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.view_mixtures import MixturesNow

NEAR_M = 1.0
"""Distance beyond which a component is another one, metres."""
MIN_MOVES = 3
"""Moves of a component that counts; those with fewer are left out."""
MIN_COMPONENTS = 10
"""Components that a curve needs."""


class ComponentMoves(MetricStage):
    """Measures how far the places at which views are seen move with each update, against how many they have had.

    Gross, Koenig & Müller 2005, section 2.3: "the influence of a single update step decreases with time, and the MoG
    stabilizes gradually". A component is followed to the nearest one of the same view after an update, where that is
    within `NEAR_M`; an update that leaves its mean as it was (one of its weight alone) does not count.

    `component_moves`: lists with an entry for each of a component's first `MIN_MOVES` moves: `updates`, how many it had
    had before, from 0 on; `moved_m`, the mean distance in x and y. They are the same components in each entry, those
    that move at least so often: others are seen elsewhere. `components`: how many they are; the lists are empty where
    there are fewer than `MIN_COMPONENTS`.
    """

    def step(self, ctx: Context, mixtures: Sequence[MixturesNow | None]) -> MetricStage.Out:
        often = [moved[:MIN_MOVES] for moved in moves(mixtures, NEAR_M) if len(moved) >= MIN_MOVES]
        enough = len(often) >= MIN_COMPONENTS
        values = {
            "updates": list(range(MIN_MOVES)) if enough else [],
            "moved_m": np.mean(often, axis=0).tolist() if enough else [],
            "components": len(often),
        }
        return self.Out(metrics=Metrics({"component_moves": values}))


def moves(mixtures: Sequence[MixturesNow | None], near_m: float) -> list[list[float]]:
    """Distances (m) that updates moved each component by, one after the other."""
    found: list[list[float]] = []
    places: dict[int, tuple[Array, list[list[float]]]] = {}  # of a view: means of its components, moves of each
    for now in mixtures:
        for name in [] if now is None else np.unique(now.ids).tolist():
            assert now is not None
            means = now.means[now.ids == name].astype(np.float64)
            known, moved = places.get(name, (np.empty((0, 3)), []))
            followed: list[list[float]] = []
            taken: set[int] = set()
            for mean in means:
                away = np.hypot(*(known[:, :2] - mean[:2]).T)
                nearest = int(away.argmin()) if len(away) else -1
                if nearest < 0 or away[nearest] > near_m or nearest in taken:
                    found.append([])
                    followed.append(found[-1])
                    continue
                taken.add(nearest)
                if not (known[nearest] == mean).all():
                    moved[nearest].append(float(away[nearest]))
                followed.append(moved[nearest])
            places[name] = means, followed
    return found
