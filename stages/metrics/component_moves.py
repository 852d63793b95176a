"""How far an update moves a place in the map that has had so many before."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Metrics, Outputs, Stage
from omninav.stages.values.drive import Array
from omninav.stages.values.view_mixtures import MixturesNow


class ComponentMoves(Stage):
    """Measures how far the places at which views are seen move with each update, against how many they have had.

    Gross, Koenig & Müller 2005, section 2.3: "the influence of a single update step decreases with time, and the MoG
    stabilizes gradually". A component is followed to the nearest one of the same view after an update, where that lies
    within `near_m`; an update that leaves its mean as it was (one of its weight alone) does not count.

    `component_moves`: lists with an entry for each number of earlier updates, from 0 on: `updates`; `moved_m`, the mean
    distance in x and y; `moves`, how many there were. Numbers with fewer than `min_moves` end the lists.
    """

    near_m: Annotated[float, Bounds(gt=0)] = 1.0
    """Distance (m) beyond which a component is another one."""
    min_moves: Annotated[int, Bounds(ge=1)] = 10
    """Moves that an entry needs."""

    class Out(Outputs):
        """`metrics`: the entry `component_moves` of metrics.json."""

        metrics: Metrics

    def step(self, ctx: Context, mixtures: Sequence[MixturesNow | None]) -> Out:
        """The whole run at once."""
        by_number: dict[int, list[float]] = {}
        for number, moved in moves(mixtures, self.near_m):
            by_number.setdefault(number, []).append(moved)
        numbers: list[int] = []
        while len(by_number.get(len(numbers), [])) >= self.min_moves:
            numbers.append(len(numbers))
        values = {
            "updates": numbers,
            "moved_m": [float(np.mean(by_number[number])) for number in numbers],
            "moves": [len(by_number[number]) for number in numbers],
        }
        return self.Out(metrics=Metrics({"component_moves": values}))


def moves(mixtures: Sequence[MixturesNow | None], near_m: float) -> list[tuple[int, float]]:
    """Each move of a component: how many updates it had had before, and its distance (m)."""
    found: list[tuple[int, float]] = []
    places: dict[int, tuple[Array, list[int]]] = {}  # of a view: means of its components, updates of each
    for now in mixtures:
        for name in [] if now is None else np.unique(now.ids).tolist():
            assert now is not None
            means = now.means[now.ids == name].astype(np.float64)
            known, updates = places.get(name, (np.empty((0, 3)), []))
            numbers = []
            for mean in means:
                away = np.hypot(*(known[:, :2] - mean[:2]).T)
                nearest = int(away.argmin()) if len(away) else -1
                if nearest < 0 or away[nearest] > near_m:
                    numbers.append(0)
                elif (known[nearest] == mean).all():
                    numbers.append(updates[nearest])
                else:
                    found.append((updates[nearest], float(away[nearest])))
                    numbers.append(updates[nearest] + 1)
            places[name] = means, numbers
    return found
