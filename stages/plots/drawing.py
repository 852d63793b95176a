"""Draws maps, grids and poses on the axes of a plan view."""

from typing import TYPE_CHECKING

import numpy as np

from omninav.stages.geometry.arrays import Array
from omninav.stages.values.grid import OCCUPIED, UNKNOWN, OccupancyGrid
from omninav.stages.values.landmarks import Landmarks
from omninav.stages.values.map_places import AnyMap
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewMixtures

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe & Ito's palette (2008), dark enough on white
ESTIMATE, TRUTH, ODOMETRY = "#0072B2", "#111111", "#D55E00"
REFERENCE, EDGE, MARK, LANDMARK = "#8a8f98", "#c9ccd1", "#009E73", "#0072B2"

LANDMARK_SHARE = 2.0
"""Landmarks on either side that do not decide how far a plot goes, per cent."""


def plan_axes(axes: "Axes", extent: tuple[float, float, float, float] | None = None) -> None:
    """Axes of a plan view: metres, equal scales, optionally the part (x from, x to, y from, y to) to show."""
    axes.set_aspect("equal", adjustable="box" if extent else "datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    if extent:
        axes.set_xlim(extent[0], extent[1])
        axes.set_ylim(extent[2], extent[3])


def draw_map(axes: "Axes", map: AnyMap) -> None:
    """Reference views as grey dots, joined by their edges; of mixtures every component's mean, as dark as it weighs; of
    a topological map its places, joined along the images between them."""
    if not len(map):
        return
    from matplotlib.collections import LineCollection
    from matplotlib.colors import to_rgba_array

    if isinstance(map, ViewMixtures):
        size = float(np.clip(3000 / max(len(map.weights), 1), 1.5, 9))
        name = f"views ({len(map)}) at {len(map.weights)} places"
        x, y = map.means[:, :2].T
        heaviest = float(map.weights.max(initial=0.0)) or 1.0
        colours = to_rgba_array(REFERENCE, np.clip(map.weights / heaviest, 0.3, 1.0))
        axes.scatter(x, y, s=size, c=colours, linewidths=0, zorder=1.5, label=name)
        return
    if isinstance(map, TopologicalMap):
        poses, what, largest = map.poses[map.places], "places", 25
        lines, colour = [map.poses[map.whole_way(link), :2] for link in range(len(map.links))], REFERENCE
    else:
        poses, what, largest = map.poses, "references", 9
        lines, colour = list(map.poses[map.edges][:, :, :2]), EDGE
    axes.add_collection(LineCollection(lines, colors=colour, linewidths=0.7, zorder=1))
    size = float(np.clip(3000 / len(map), 1.5, largest))
    name = f"{what} ({len(map)})"
    axes.scatter(poses[:, 0], poses[:, 1], s=size, color=REFERENCE, linewidths=0, zorder=1.5, label=name)


def draw_landmarks(axes: "Axes", landmarks: Landmarks | None) -> None:
    """Landmarks from above, as specks under everything else."""
    if landmarks is None or not len(landmarks):
        return
    x, y = shown_landmarks(landmarks).T
    name = f"landmarks ({len(landmarks)})"
    speck = float(np.clip(20_000 / len(landmarks), 0.2, 2.0))
    axes.scatter(x, y, s=speck, color=LANDMARK, alpha=0.5, linewidths=0, zorder=0.8, label=name, rasterized=True)


def shown_landmarks(landmarks: Landmarks) -> Array:
    """x and y (N, 2) of the landmarks, without the few that are far from all others: depths may be uncertain."""
    xy = landmarks.points[:, :2].astype(np.float64)
    if not len(xy):
        return xy
    low, high = np.percentile(xy, [LANDMARK_SHARE, 100.0 - LANDMARK_SHARE], axis=0)
    pad = 0.1 * float((high - low).max())
    shown: Array = xy[((xy >= low - pad) & (xy <= high + pad)).all(axis=1)]
    return shown


def landmarks_of(map: AnyMap | None) -> Array:
    """x and y (N, 2) of the landmarks of a map that are shown; none of a map without."""
    landmarks = map.landmarks if isinstance(map, ReferenceGraph) else None
    return np.empty((0, 2)) if landmarks is None else shown_landmarks(landmarks)


def draw_grid(axes: "Axes", grid: OccupancyGrid | None) -> None:
    """Draws occupied cells in dark grey and unknown ones in light grey, under everything else."""
    if grid is None:
        return
    from matplotlib.colors import to_rgba

    colours = np.zeros((*grid.cells.shape, 4))
    colours[grid.cells == OCCUPIED] = to_rgba("#6d727b")
    colours[grid.cells == UNKNOWN] = to_rgba("#eceef1")
    axes.imshow(colours, extent=grid_extent(grid), origin="lower", interpolation="nearest", zorder=0.4)


def grid_extent(grid: OccupancyGrid) -> tuple[float, float, float, float]:
    """Extent of a grid: x from, x to, y from, y to (m)."""
    rows, columns = grid.cells.shape
    x, y = grid.origin
    return x, x + columns * grid.resolution, y, y + rows * grid.resolution


def extent_of(*points: Array, margin: float = 0.06) -> tuple[float, float, float, float] | None:
    """The part of the plane that holds all finite points, (N, 2 or more) each, with a margin; None: there are none."""
    together = np.concatenate([np.empty((0, 2)), *(p[:, :2] for p in points)])
    together = together[np.isfinite(together).all(axis=1)]
    if not len(together):
        return None
    low, high = together.min(axis=0), together.max(axis=0)
    pad = margin * float((high - low).max()) + 0.25
    return float(low[0] - pad), float(high[0] + pad), float(low[1] - pad), float(high[1] + pad)


def fitting_height(extent: tuple[float, float, float, float] | None, width: float, low: float, high: float) -> float:
    """Height (inches) of an equal-axes plot of `extent` that has this width, within limits."""
    if extent is None:
        return low
    shape = (extent[3] - extent[2]) / (extent[1] - extent[0])
    return float(np.clip(width * shape + 0.9, low, high))
