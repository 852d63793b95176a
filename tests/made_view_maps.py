"""Maps of views for tests: views that look like points, and where they were seen from."""

import numpy as np

from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients


def view(*values: float) -> Coefficients:
    """A view whose distance to another is that of these numbers to the other's, by one 0 more where there is one."""
    row = np.array([*values, 0.0] if len(values) == 1 else values, np.float32)
    return Coefficients(row, row[None])


def learned(
    look: float,
    *places: object,
    sigma: float = 0.1,
    weights: float | tuple[float, ...] = 0.5,
    count: float = 3.0,
    map: ViewMixtures | None = None,
) -> ViewMixtures:
    """A map, or `map` with more in it: `view(look)`, seen from these places, each x (m) or a pose."""
    made = ViewMixtures.empty() if map is None else map
    row = made.add_view(view(look).values, "Coefficients")
    for place, weight in zip(places, np.broadcast_to(weights, len(places)), strict=True):
        pose = np.array(place if isinstance(place, tuple) else (place, 0.0, 0.0), np.float64)
        made.add_component(row, pose, sigma**2 * np.eye(3), float(weight), count)
    return made
