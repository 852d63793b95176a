"""Fate of references that were learned at a wrong place."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.values.drive import Drive
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent

SPECS = {
    "mislocalised_references.references": MetricSpec(title="References learned at a wrong place", better="lower"),
    "mislocalised_references.kept": MetricSpec(title="Wrong places kept to the end", better="lower"),
}
WRONG_M = 2.0
"""Distance from the true position beyond which a place is wrong, metres."""
POINTS = 60
"""Length of the lists over the frames."""


class MislocalisedReferences(MetricStage):
    """Measures how long references stay at wrong places, such as those learned right after a kidnapping.

    A reference counts whose heaviest component is far from the true position of the frame in which it was seen, at
    its coming. Of its weight, the share at places that far off is followed to the end. Under `mislocalised_references`:
    `references`, how many there are; `kept`, of how many some of that weight is left at the end; lists with an entry
    for each of them in the order in which they were seen: `along_m`, the true path length (m) from where the first of
    them was seen to where it was, and `gone_after_steps`, how many frames after it came that share had become 0 (None:
    never), which is as many for all where all are corrected in as many laps; lists over the frames: `step`, and
    `weight`, the mean share of all that had come by then (None before the first). `example`: `step` and `weight` of the
    first of them. Only `references` where there are none.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        mixtures: Sequence[MixturesNow | None],
    ) -> MetricStage.Out:
        path = drive.truth[:, :2]
        seen, came, shares = wrong_shares(events, mixtures, path, WRONG_M)
        values: dict[str, Any] = {"references": len(seen)}
        if len(seen):
            ways = np.hypot(*np.diff(path, axis=0).T)
            ways = np.concatenate([[0.0], np.cumsum(np.nan_to_num(ways))])
            gone = np.array([np.flatnonzero(share > 0.0)[-1] + 1 for share in shares])
            steps = np.unique(np.linspace(0, len(path) - 1, min(POINTS, len(path))).round().astype(np.int64))
            values |= {
                "kept": int((gone == len(path)).sum()),
                "along_m": (ways[seen] - ways[seen[0]]).tolist(),
                "gone_after_steps": [
                    int(end - first) if end < len(path) else None for first, end in zip(came, gone, strict=True)
                ],
                "step": steps.tolist(),
                "weight": [_mean_of_those(shares[:, step], came <= step) for step in steps],
                "example": {"step": steps.tolist(), "weight": shares[0, steps].tolist()},
            }
        return self.Out(metrics=Metrics({"mislocalised_references": values}, SPECS))


def wrong_shares(
    events: Sequence[ViewEvent | None], mixtures: Sequence[MixturesNow | None], path: Array, wrong_m: float
) -> tuple[Ints, Ints, Array]:
    """References that came at a wrong place: the frames in which each was seen and came, and its share in each frame.

    (R,), (R,) and (R, N), in the order in which they were seen. `path`: true positions (N, 2), NaN where there is none.
    """
    seen: dict[int, int] = {}
    came: dict[int, int] = {}
    now: dict[int, float] = {}
    rows: list[dict[int, float]] = []
    for frame, (event, parts) in enumerate(zip(events, mixtures, strict=True)):
        if event is not None:
            seen |= zip(event.inserted.tolist(), event.seen.tolist(), strict=True)
            for name in event.removed.tolist():
                now.pop(name, None)
        if parts is not None:
            for name in np.unique(parts.ids).tolist():
                if name not in seen or not np.isfinite(path[seen[name]]).all():
                    continue
                mine = parts.ids == name
                weights = parts.weights[mine].astype(np.float64)
                off = np.hypot(*(parts.means[mine, :2] - path[seen[name]]).T) > wrong_m
                begins = event is not None and name in event.inserted and off[np.argmax(weights)]
                if begins:
                    came[name] = frame
                if name in came:
                    now[name] = float(weights[off].sum() / weights.sum()) if weights.sum() else 0.0
        rows.append(dict(now))
    names = sorted(came, key=lambda name: (seen[name], name))
    shares = np.array([[row.get(name, 0.0) for row in rows] for name in names]).reshape(len(names), len(rows))
    frames = np.array([(seen[name], came[name]) for name in names], np.int64).reshape(-1, 2)
    return frames[:, 0], frames[:, 1], shares


def _mean_of_those(shares: Array, there: Bools) -> float | None:
    return float(shares[there].mean()) if there.any() else None
