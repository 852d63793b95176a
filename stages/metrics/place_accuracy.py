"""Share of images whose most probable place is the right one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.topological_map import TopologicalMap

SPECS = {
    "localisation.accuracy": MetricSpec(title="Right place", unit="%", better="higher"),
    "localisation.adjacent_accuracy": MetricSpec(title="Right or an adjacent place", unit="%", better="higher"),
    "localisation.place_distance_m": MetricSpec(title="Distance to the believed place, median", better="lower"),
    "localisation.nearest_place_distance_m": MetricSpec(title="Distance to the nearest place, median"),
    "localisation.images": MetricSpec(title="Images localised", context=True),
}
HEADLINES = tuple(f"localisation.{name}" for name in ("accuracy", "adjacent_accuracy", "place_distance_m", "images"))

TOLERANCE_M = 0.5
"""Distance by which a medoid may be farther than the closest for `tolerant_accuracy_after`, metres."""
UPDATES = 5
"""Length of the lists by update."""


class PlaceAccuracy(MetricStage):
    """Measures how often the most probable place is the one truly nearest to the robot.

    Goedemé et al. 2007, section 8.3. Under `localisation`, over all logs: `accuracy`, the share of all images;
    `adjacent_accuracy`: the believed place is the closest or one of its neighbours; `accuracy_after`: of the first,
    second ... update since the belief began (`begun`: at which images it did), as the paper counts, and
    `adjacent_accuracy_after`; `image_accuracy_after`: the believed place has the closest medoid, or the closest of all
    images that the map keeps (where a place is long, its medoid is far from its ends); `tolerant_accuracy_after`: its
    medoid is hardly further away than the closest (where the tour came by twice, two medoids may be side by side).
    `place_distance_m`: the median distance between the believed place's medoid and the truth, and
    `nearest_place_distance_m`, the closest one's. Gives nothing where poses or the map's are not ground truth.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[PlaceBelief | None],
        begun: Sequence[PlaceBelief | None],
        map: TopologicalMap,
    ) -> MetricStage.Out:
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
            "images": len(rows),
            "accuracy": float(rights.mean()),
            "adjacent_accuracy": float(nears.mean()),
            "accuracy_after": _after(rights, after, UPDATES),
            "adjacent_accuracy_after": _after(nears, after, UPDATES),
            "image_accuracy_after": _after(within, after, UPDATES),
            "tolerant_accuracy_after": _after(metres_off - least <= TOLERANCE_M, after, UPDATES),
            "place_distance_m": float(np.median(metres_off)),
            "nearest_place_distance_m": float(np.median(least)),
        }
        return self.Out(metrics=Metrics({"localisation": found}, SPECS, HEADLINES))


def _after(hits: np.ndarray, after: np.ndarray, updates: int) -> list[float | None]:
    """The share of hits at the first, second ... update; None where there was none."""
    return [float(hits[after == k].mean()) if (after == k).any() else None for k in range(1, updates + 1)]
