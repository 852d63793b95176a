"""Cuts a saved map to an area."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput, Context, Tool
from omninav.stages.map_files.places import cut_places
from omninav.stages.map_files.references import cut_references
from omninav.stages.map_files.saved import MapOfPlaces, read_saved, target, write_saved
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Coordinate

Area = tuple[Coordinate, Coordinate, Coordinate, Coordinate]


class CutMap(Tool):
    """Writes the part of a map that lies in an area: its references or places, and the edges or links between them.

    Raises BadInput where the file is no such map, or nothing of it lies there.
    """

    example = "a.omap area=[0,0,10,5] out=cut.omap"

    maps: str | tuple[str, ...]
    """The map (.omap)."""
    area: Area
    """x0, y0, x1, y1 (m): two opposite corners, in the map's frame."""
    out: str = "cut.omap"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        """Cut the map."""
        (source,) = read_saved(self.maps, at_most=1)
        path, whole = target(self.out, [source]), source.map
        poses = poses_of(whole)
        inside = within_area(poses, self.area)
        if not inside.any():
            edges = (edge(poses[:, :2], axis=0).round(1).tolist() for edge in (np.min, np.max)) if len(poses) else ()
            where = f"it goes from {' to '.join(map(str, edges))}" if len(poses) else "it is empty"
            raise BadInput(f"area={list(self.area)}: nothing of {source.path} lies there; {where}")
        left = cut_references(whole, inside) if isinstance(whole, ReferenceGraph) else cut_places(whole, inside)
        write_saved(path, left, [source], f"cut area={list(self.area)}")
        what = "references" if isinstance(whole, ReferenceGraph) else "places"
        print(f"{path}: {len(left)} of {len(whole)} {what}")


def poses_of(map: MapOfPlaces) -> npt.NDArray[np.float64]:
    """Poses of references, or places: (N, 3)."""
    return map.poses if isinstance(map, ReferenceGraph) else map.poses[map.places]


def within_area(poses: npt.NDArray[np.float64], area: Area) -> npt.NDArray[np.bool_]:
    """Which poses (N, 3) lie in an area, its edges included: (N,)."""
    corners = np.array(area).reshape(2, 2)
    inside: npt.NDArray[np.bool_] = ((poses[:, :2] >= corners.min(axis=0)) & (poses[:, :2] <= corners.max(axis=0))).all(
        axis=1
    )
    return inside
