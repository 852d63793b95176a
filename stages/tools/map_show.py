"""Shows a saved map: what it holds as lines, and where as a picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.spatial import KDTree

from omninav.pipeline import BadInput, Context, Tool, user_path, write_whole
from omninav.pipeline.engine.artifact import read_artifact, read_header
from omninav.pipeline.report.plot_style import plot, plot_file
from omninav.stages.plots.drawing import draw_grid, draw_landmarks, draw_map, plan_axes
from omninav.stages.recordings.occupancy_grid import read_occupancy
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.topological_map import TopologicalMap

SAMPLE = 10_000
"""Poses of which the distance to the nearest other one is measured, and references that are drawn."""


class ShowMap(Tool):
    """Prints what saved maps hold, and draws where their references or places are, over a grid where one is given.

    Raises BadInput where a file is no map.
    """

    example = "a.omap grid=office.yaml out=office.png"

    maps: str | tuple[str, ...]
    """The maps (.omap)."""
    grid: str | None = None
    """An occupancy grid (map.yaml) to draw under them."""
    out: str = "map.png"
    """The file to write; of several maps one beneath the other."""

    def run(self, ctx: Context) -> None:
        names = (self.maps,) if isinstance(self.maps, str) else self.maps
        path = plot_file(self.out)
        if not names:
            raise BadInput("maps: name a map, and a .png to write: FILE.omap out=map.png")
        grid = read_occupancy(user_path(self.grid)) if self.grid is not None else None
        maps = {file: _read(file) for file in map(user_path, names)}
        with plot(7.0, 5.5 * len(maps)) as drawn:
            for axes, (file, shown) in zip(
                drawn.canvas.subplots(len(maps), squeeze=False)[:, 0], maps.items(), strict=True
            ):
                print("\n".join(f"{name:<12} {fact}" for name, fact in described(file, shown)))
                plan_axes(axes)
                draw_grid(axes, grid)
                draw_landmarks(axes, shown.landmarks if isinstance(shown, ReferenceGraph) else None)
                draw_map(axes, _sampled(shown))
                axes.set_title(file.name)
                if len(shown):
                    axes.legend()
        write_whole(path, drawn.content)
        print(f"{'picture':<12} {path}")


def _read(file: Path) -> AnyMap:
    value = read_artifact(file)
    if not isinstance(value, AnyMap):
        kinds = ", ".join(kind.__name__ for kind in get_args(AnyMap))
        raise BadInput(f"{file}: it holds a {type(value).__name__}, no map ({kinds})")
    return value


def described(file: Path, map: AnyMap) -> Iterator[tuple[str, Any]]:
    """Content of a map: names and facts."""
    yield "map", f"{file} ({type(map).__name__}, {file.stat().st_size / 1e6:.2f} MB)"
    if isinstance(map, ReferenceGraph):
        segments, bins = map.features.shape[1:]
        yield "references", f"{len(map)}, {len(map.edges)} edges between them"
        yield "views", f"{map.kind}, {segments} segments x {bins}, {map.features.nbytes / 1e6:.1f} MB"
        yield "landmarks", described_landmarks(map)
    elif isinstance(map, TopologicalMap):
        yield (
            "places",
            f"{len(map)} ({len({*map.names} - {''})} names), {len(map.links)} links, {len(map.ways)} path images",
        )
        yield (
            "views",
            f"{len(map.views)}, of {len(map.views.directions) / max(len(map.views), 1):.0f} patches on average",
        )
    else:
        yield "views", f"{len(map)} at {len(map.weights)} places"
    poses = map_poses(map)
    yield "poses from", map.pose_source
    if len(poses):
        (x0, y0), (x1, y1) = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
        yield "area", f"{x1 - x0:.1f} x {y1 - y0:.1f} m: x {x0:.1f} to {x1:.1f}, y {y0:.1f} to {y1:.1f}"
    if len(poses) > 1:
        some = poses[np.unique(np.linspace(0, len(poses) - 1, min(len(poses), SAMPLE)).astype(np.int64)), :2]
        tree: Any = KDTree(poses[:, :2])
        gaps = tree.query(some, k=2)[0][:, 1]
        yield "spacing", f"{np.median(gaps):.2f} m to the nearest other (median), {gaps.max():.2f} m at most"
    facts = read_header(file)["facts"]
    stages = facts.get("stages")
    for node in ("unwarp", "features") if isinstance(stages, dict) else ():
        if isinstance(stages.get(node), dict):
            target = str(stages[node].get("_target_")).rpartition(".")[2]
            settings = (f"{key}={value}" for key, value in stages[node].items() if key != "_target_")
            yield node, ", ".join([target, *settings])[:300]
    for name, key in (("made by", "made_by"), ("variant", "variant")):
        if isinstance(facts.get(key), str):
            yield name, facts[key][:300]


def described_landmarks(map: ReferenceGraph) -> str:
    """The number of landmarks, how many of them references see, and how well, in words."""
    landmarks = map.landmarks
    if landmarks is None:
        return "none; type landmarks=sift where a map is made"
    sees = np.diff(landmarks.starts)
    none = len(map) - np.count_nonzero(sees)
    few = f", {none} references see none" if none else ""
    return (
        f"{len(landmarks)}, a reference sees {np.median(sees) if len(sees) else 0:.0f} (median){few}; "
        f"bearings to {np.degrees(landmarks.sigma_rad):.2f} deg, pose variances x {landmarks.variance_factor:.1f}"
    )


def _sampled(map: AnyMap) -> AnyMap:
    """A map with fewer references, as far as that cannot be seen."""
    if not isinstance(map, ReferenceGraph) or len(map) <= SAMPLE:
        return map
    rows = np.unique(np.linspace(0, len(map) - 1, SAMPLE).astype(np.int64))
    return ReferenceGraph(
        map.poses[rows], np.empty((len(rows), 0, 0), np.float32), map.kind, map.edges[:0], map.pose_source
    )
