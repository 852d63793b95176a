"""Thins a saved map."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Tool
from omninav.stages.map_files.places import thinned_places
from omninav.stages.map_files.references import thinned_references
from omninav.stages.map_files.saved import MapOfPlaces, read_saved, target, write_saved
from omninav.stages.values.maps import ReferenceGraph


class ThinMap(Tool):
    """Writes a map with fewer references, at least `spacing` apart.

    In their order each reference takes the place of those around it, and their edges. Of a topological map, path images
    are left out, and no places. Raises BadInput where the file is no such map.
    """

    example = "a.omap spacing=0.5 out=thinned.omap"

    maps: str | tuple[str, ...]
    """The map (.omap)."""
    spacing: Annotated[float, Bounds(gt=0, le=1e6)] = 0.5
    """Smallest distance (m) between two references, or two path images of a way."""
    out: str = "thinned.omap"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        (source,) = read_saved(self.maps, at_most=1)
        path, map = target(self.out, [source]), source.map
        if isinstance(map, ReferenceGraph):
            left: MapOfPlaces = thinned_references(map, self.spacing)
            kept = f"{len(left)} of {len(map)} references"
        else:
            left = thinned_places(map, self.spacing)
            kept = f"{len(left.ways)} of {len(map.ways)} path images"
        write_saved(path, left, [source], f"thin spacing={self.spacing:g}")
        print(f"{path}: {kept}, at least {self.spacing:g} m apart")
