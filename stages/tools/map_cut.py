"""Cuts a saved map to an area."""

import numpy as np

from omninav.pipeline import BadInput, Context, Tool
from omninav.stages.map_files.places import cut_places
from omninav.stages.map_files.references import cut_references
from omninav.stages.map_files.saved import read_saved, target, write_saved
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Coordinate

Area = tuple[Coordinate, Coordinate, Coordinate, Coordinate]


class CutMap(Tool):
    """Writes the part of a map that is in an area: its references or places, and the edges or links between them.

    Raises BadInput where the file is no such map, or nothing of it is there.
    """

    example = "a.omap area=[0,0,10,5] out=cut.omap"

    maps: str | tuple[str, ...]
    """The map (.omap)."""
    area: Area
    """x0, y0, x1, y1 (m): two opposite corners, in the map's frame."""
    out: str = "cut.omap"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        (source,) = read_saved(self.maps, at_most=1)
        path, whole = target(self.out, [source]), source.map
        poses = whole.poses if isinstance(whole, ReferenceGraph) else whole.poses[whole.places]
        low, high = np.sort(np.array(self.area).reshape(2, 2), axis=0)
        inside = ((poses[:, :2] >= low) & (poses[:, :2] <= high)).all(axis=1)
        if not inside.any():
            edges = (edge(poses[:, :2], axis=0).round(1).tolist() for edge in (np.min, np.max)) if len(poses) else ()
            where = f"it goes from {' to '.join(map(str, edges))}" if len(poses) else "it is empty"
            raise BadInput(f"area={list(self.area)}: nothing of {source.path} is there; {where}")
        left = cut_references(whole, inside) if isinstance(whole, ReferenceGraph) else cut_places(whole, inside)
        write_saved(path, left, [source], f"cut area={list(self.area)}")
        what = "references" if isinstance(whole, ReferenceGraph) else "places"
        print(f"{path}: {len(left)} of {len(whole)} {what}")
