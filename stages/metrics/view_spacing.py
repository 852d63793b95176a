"""Spacing of the views of a map, among views and on the floor."""

import dataclasses
from typing import Any

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.values.drive import Drive
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import WholeView

SPECS = {
    "spacing.between_views.unevenness": MetricSpec(title="Unevenness of the map among views", better="lower"),
    "spacing.between_places_m.unevenness": MetricSpec(title="Unevenness of the map on the floor", better="lower"),
    **{
        f"spacing.{between}.{key}": MetricSpec(title=f"{title}, {word}", unit=unit)
        for between, title, unit in (
            ("between_places_m", "Distance of a place to the nearest one", "m"),
            ("between_views", "Distance of a view to the nearest one (its own measure)", None),
        )
        for key, word in (
            ("mean", "mean"),
            ("median", "median"),
            ("p10", "10th percentile"),
            ("p90", "90th percentile"),
        )
    },
}
MAX_VIEWS = 500
"""Views that are measured of a larger map, evenly picked by age."""


class ViewSpacing(MetricStage):
    """Measures how far each view of a map is from its nearest other one, in the views' own distance and in metres.

    Porta & Kroese 2004, section 5: learning on-line "guarantees a uniform sampling of the feature space and not of the
    geometric space, as it happens in normal appearance-based localization". Under `spacing`: `between_views` (in the
    views' unit) and `between_places_m` (between the heaviest components' x, y), each with `mean`, `median`, `p10`,
    `p90` and `unevenness`, the standard deviation over the mean, which has no unit: 0 where all are evenly spaced.
    Nothing for a map of fewer than three views.
    """

    def step(self, ctx: Context, drive: Drive, map: ViewMixtures, view: WholeView) -> MetricStage.Out:
        """The map at the end of the run, which `drive` waits for; `view`: the last one seen, for how to compare."""
        if len(map) < 3:
            return self.Out(metrics=Metrics({}))
        rows = np.unique(np.linspace(0, len(map) - 1, min(MAX_VIEWS, len(map))).round().astype(np.int64))
        among, apart = nearest_views(map, view, rows), nearest_places(map)[rows]
        found = {"between_views": spaced(among), "between_places_m": spaced(apart)}
        return self.Out(metrics=Metrics({"spacing": found}, SPECS))


def nearest_views(map: ViewMixtures, view: WholeView, rows: Ints) -> Array:
    """The distance of some views of a map, `rows` (N,), to their nearest other ones, as they were kept: (N,)."""
    nearest = np.empty(len(rows))
    for number, row in enumerate(rows):
        distances = _as_kept(view, map.views[row]).distances(map.views)
        distances[row] = np.inf
        nearest[number] = distances.min()
    return nearest


def nearest_places(map: ViewMixtures) -> Array:
    """The distance (m) of each view's heaviest place (R,) to that of the nearest other view."""
    by_owner = np.lexsort((map.weights, map.owner))
    ends = np.searchsorted(map.owner[by_owner], np.arange(len(map)), side="right")
    places = map.means[by_owner[ends - 1], :2]
    apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    nearest: Array = apart.min(axis=1)
    return nearest


def spaced(nearest: Array) -> dict[str, Any]:
    """Figures of distances to nearest neighbours (R,)."""
    mean = float(nearest.mean())
    return {
        "mean": mean,
        "median": float(np.median(nearest)),
        "p10": float(np.percentile(nearest, 10)),
        "p90": float(np.percentile(nearest, 90)),
        "unevenness": float(nearest.std() / mean) if mean else None,
    }


def _as_kept(view: WholeView, values: Floats) -> WholeView:
    # A view with a kept one's numbers. What it would look like turned is not kept, so it is compared as it is.
    own: dict[str, Any] = {"values": values}
    if any(field.name == "turned" for field in dataclasses.fields(view)):
        own["turned"] = values[None]
    return dataclasses.replace(view, **own)
