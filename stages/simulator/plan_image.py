"""Draws a floor plan of a world with driven paths."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from omninav.pipeline import write_whole

from .lighting import lamps_on
from .world import World, outline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    "furniture": "#b9c3cf",
    "shelf": "#c58b4e",
    "stock": "#e0c097",
    "block": "#8a8f98",
    "plant": "#7fb069",
    "wall": "#444444",
    "door": "#c0392b",
    "hanging": "#3d7ab8",
}
"""Bodies in drawing order; roofs are not drawn."""
LAMP_ON, LAMP_OFF = "#ffe98a", "#cfcfcf"
GROUNDS = {"grass": "#e4f0d8", "paving": "#efece6", "asphalt": "#e3e3e3", "carpet": "#f0eaf5", "parquet": "#f6ead9"}
"""Colours of floors other than white."""


def draw_plan(world: World, path: Path, drives: Mapping[str, npt.ArrayLike] | None = None) -> None:
    """Write a PNG of a world from above: bodies, doors, lamps, rooms with names, and driven poses (N, 2 or 3) by name.

    A drive begins at a filled and ends at an open circle. The same world gives the same bytes with the same matplotlib.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    config = world.config
    width, depth = config.size
    scale = min(0.9, 15.0 / max(width, depth))
    figure = Figure(figsize=(max(5.0, scale * width) + 1.2, max(3.0, scale * depth) + 1.0), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_facecolor(GROUNDS.get(config.floor, "white"))
    for room in config.rooms:
        colour = GROUNDS.get(room.floor or config.floor, "white")
        axes.add_patch(Rectangle(room.corner, *room.size, facecolor=colour, edgecolor="none", zorder=0.5))
    thin = 0.4 if max(width, depth) < 50 else 0.15
    for layer, (kind, colour) in enumerate(COLOURS.items()):
        bodies = [outline(box) for box in world.boxes if box.kind == kind]
        shape = PolyCollection(bodies, facecolor=colour, edgecolor="black", linewidth=thin, zorder=1 + 0.1 * layer)
        axes.add_collection(shape)
    lamps = [outline(box) for box in world.boxes if box.kind == "lamp"]
    colours = [LAMP_ON if on else LAMP_OFF for on in lamps_on(world.layout.lamps, config, world.day)]
    axes.add_collection(PolyCollection(lamps, facecolor=colours, edgecolor="none", alpha=0.6, zorder=2.5))
    for room in config.rooms:
        middle = (room.corner[0] + room.size[0] / 2, room.corner[1] + room.size[1] / 2)
        _name(axes, room.name, middle, 90 if room.size[1] > 3 * room.size[0] else 0)
    for block in config.aisle_blocks:
        if block.name:
            _name(axes, block.name, (block.corner[0] + block.size[0] / 2, block.corner[1] + block.size[1] / 2), 0)
    for name, poses in (drives or {}).items():
        driven = np.asarray(poses, dtype=np.float64)
        (line,) = axes.plot(driven[:, 0], driven[:, 1], linewidth=1.2, alpha=0.85, label=name, zorder=3)
        axes.plot(*driven[0, :2], "o", markersize=5, color=line.get_color(), zorder=3.1)
        axes.plot(*driven[-1, :2], "o", markersize=6, color=line.get_color(), fillstyle="none", zorder=3.1)
    edge = 0.01 * max(width, depth) + 0.3
    axes.set(aspect="equal", xlim=(-edge, width + edge), ylim=(-edge, depth + edge), xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"{config.name}, {width:g} x {depth:g} m, day {world.day}")
    if drives:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    figure.tight_layout()
    png = BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    write_whole(path, png.getvalue())


def _name(axes: "Axes", name: str, at: tuple[float, float], turn: float) -> None:
    box = {"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "boxstyle": "round,pad=0.15"}
    axes.text(*at, name, ha="center", va="center", rotation=turn, fontsize=7, zorder=4, bbox=box)
