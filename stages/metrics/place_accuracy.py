"""How often the most probable place is the right one."""

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.results import Metrics
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.topological_map import TopologicalMap


class PlaceAccuracy(Stage):
    """The share of pictures at which the belief's maximum is at the place whose medoid was taken closest to the truth.

    Goedemé et al. 2007, section 8.3. Under `localisation`, over all logs: `right_rate` of all pictures; `near_rate`:
    the believed place is the closest or one of its neighbours; `right_after`: of the first, second ... of `updates`
    updates since the belief began (`begun`: at which pictures it did), as the paper counts, and `near_after`;
    `within_after`: the believed place has the closest medoid, or the closest of all images that the map keeps (where a
    place is long, its medoid lies far from its ends); `beside_after`: its medoid is at most `beside_m` further away
    than the closest (where the tour came by twice, two medoids may lie side by side). `median_apart_m`: how far the
    believed place's medoid lies from the truth, and `least_apart_m`, the closest one's.
    """

    updates: Annotated[int, Bounds(ge=1)] = 5
    beside_m: Annotated[float, Bounds(ge=0)] = 0.5

    class Out(Outputs):
        """`metrics`: the entry `localisation` of metrics.json; absent where poses or the map's are not ground truth."""

        metrics: Metrics | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[PlaceBelief | None],
        begun: Sequence[PlaceBelief | None],
        map: TopologicalMap,
    ) -> Out:
        """The whole run at once."""
        medoids, apart = map.poses[map.places][:, :2], links_between(map.links, len(map))
        images = map.poses[:, :2]
        if map.pose_source != "truth":
            return self.Out()
        rows, since = [], 0
        for belief, begins, true, there in zip(beliefs, begun, drive.truth[:, :2], known(drive.truth), strict=True):
            since = 1 if begins is not None else since + 1
            if belief is not None and there:
                metres = np.hypot(*(medoids - true).T)
                place, closest = int(np.argmax(belief.probabilities)), int(np.argmin(metres))
                owner = int(map.owner[np.argmin(np.hypot(*(images - true).T))])
                right, near = place == closest, apart[place, closest] <= 1
                rows.append((since, right, near, right or place == owner, metres[place], metres[closest]))
        if not rows:
            return self.Out()
        after, rights, nears, within, metres_off, least = (np.array(column) for column in zip(*rows, strict=True))
        found: dict[str, Any] = {
            "pictures": len(rows),
            "right_rate": float(rights.mean()),
            "near_rate": float(nears.mean()),
            "right_after": _after(rights, after, self.updates),
            "near_after": _after(nears, after, self.updates),
            "within_after": _after(within, after, self.updates),
            "beside_after": _after(metres_off - least <= self.beside_m, after, self.updates),
            "median_apart_m": float(np.median(metres_off)),
            "least_apart_m": float(np.median(least)),
        }
        return self.Out(metrics=Metrics({"localisation": found}))


def _after(hits: np.ndarray, after: np.ndarray, updates: int) -> list[float | None]:
    """The share of hits at the first, second ... update; None where there was none."""
    return [float(hits[after == k].mean()) if (after == k).any() else None for k in range(1, updates + 1)]
