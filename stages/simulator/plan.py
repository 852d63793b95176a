"""A floor plan of a world, with its routes, as a picture."""

from collections.abc import Mapping
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from omninav.pipeline.files import write_whole

from .world import World, outline

COLOURS = {"wall": "#444444", "shelf": "#c58b4e", "stock": "#e0c097", "block": "#8a8f98", "hanging": "#3d7ab8"}


def draw_plan(world: World, path: Path, drives: Mapping[str, npt.ArrayLike] | None = None) -> None:
    """Write a PNG of a world from above: bodies, lamps, routes, and driven poses (N, 3) by name.

    The same world gives the same bytes with the same matplotlib.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    width, depth = world.config.size
    scale = min(1.0, 40.0 / max(width, depth))
    figure = Figure(figsize=(max(4.0, 0.9 * scale * width), max(3.0, 0.9 * scale * depth) + 0.6), dpi=100)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for box in world.boxes:
        if box.kind == "lamp":
            axes.add_patch(Polygon(outline(box), facecolor="#ffe98a", edgecolor="none", alpha=0.7))
        else:
            axes.add_patch(Polygon(outline(box), facecolor=COLOURS[box.kind], edgecolor="black", linewidth=0.4))
    for name, route in world.config.routes.items():
        points = np.asarray(route.waypoints)
        axes.plot(points[:, 0], points[:, 1], ".--", linewidth=0.8, label=f"route {name}")
    for name, poses in (drives or {}).items():
        driven = np.asarray(poses)
        axes.plot(driven[:, 0], driven[:, 1], linewidth=1.4, label=name)
    axes.set(aspect="equal", xlim=(-0.4, width + 0.4), ylim=(-0.4, depth + 0.4), xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"{world.config.name}, {width:g} x {depth:g} m")
    if axes.lines:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8)
    figure.tight_layout()
    picture = BytesIO()
    figure.savefig(picture, format="png", metadata={"Software": None})
    write_whole(path, picture.getvalue())
