"""Thumbnails of a map's references or views, for reports: the map itself holds no images."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Value
from omninav.stages.camera.model import Camera
from omninav.stages.camera.thumbnail import thumbnail
from omninav.stages.values.image import Image, Panorama, Windows
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.thumbnails import Thumbnails
from omninav.stages.values.topological_map import TopologicalMap

TOUR_COLUMNS = 240
"""Largest width of a thumbnail of a tour, pixels."""
QUALITY = 75
"""JPEG quality of a thumbnail, per cent."""


class ReferenceThumbnails(Value):
    """Thumbnails of the references that a tick added to a map, as JPEG bytes, in the map's order."""

    jpegs: tuple[bytes, ...]


class ThumbnailsState(State):
    """Number of references with a thumbnail."""

    references: int = 0


class ReferenceSnapshot(Stage):
    """Encodes thumbnails of references as they are added to a map.

    A panorama is one reference, each window is one. Wire the map from the stage that adds to it.
    """

    columns: Annotated[int, Bounds(ge=16)] = 160
    """Largest width (pixels)."""

    class Out(Outputs):
        """`snapshots`: absent where the map did not grow."""

        snapshots: ReferenceThumbnails | None = None

    def step(self, ctx: Context, panorama: Panorama | Windows, map: ReferenceGraph, thumbnails: ThumbnailsState) -> Out:
        if len(map) <= thumbnails.references:
            return self.Out()
        seen = list(panorama.pixels) if isinstance(panorama, Windows) else [panorama.pixels]
        new = len(map) - thumbnails.references
        thumbnails.references = len(map)
        jpegs = (thumbnail(pixels, None, self.columns).jpeg(QUALITY) for pixels in seen[:new])
        return self.Out(snapshots=ReferenceThumbnails(tuple(jpegs)))


class CollectThumbnails(Stage):
    """Collects the thumbnails of all references of a map, to be saved in a file of their own."""

    class Out(Outputs):
        thumbnails: Thumbnails

    def step(self, ctx: Context, snapshots: Sequence[ReferenceThumbnails]) -> Out:
        return self.Out(thumbnails=joined([jpeg for some in snapshots for jpeg in some.jpegs]))


class TourSnapshot(Stage):
    """Encodes a thumbnail of every image of a tour; of a mirror's or a fisheye's image only the disc.

    Which of them a topological map keeps is known at its end only.
    """

    class Out(Outputs):
        snapshots: ReferenceThumbnails

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        jpeg = thumbnail(image.pixels, camera, TOUR_COLUMNS).jpeg(QUALITY)
        return self.Out(snapshots=ReferenceThumbnails((jpeg,)))


class ViewThumbnails(Stage):
    """Collects the thumbnails of a topological map's views; those of a `known` map's views are missing."""

    class Out(Outputs):
        thumbnails: Thumbnails

    def step(
        self,
        ctx: Context,
        snapshots: Sequence[ReferenceThumbnails | None],
        map: TopologicalMap,
        known: TopologicalMap | None = None,
    ) -> Out:
        """The whole tour at once, an entry of `snapshots` for each frame counted on from the known map's."""
        first = 0 if known is None or not len(known.frames) else 1 + int(known.frames.max())
        rows = (map.frames - first).tolist()
        found = [snapshots[row] if row >= 0 else None for row in rows]
        return self.Out(thumbnails=joined([b"" if some is None else some.jpegs[0] for some in found]))


def joined(jpegs: Sequence[bytes]) -> Thumbnails:
    """Thumbnails in one value; b"" for a missing one."""
    ends = np.cumsum([0, *(len(jpeg) for jpeg in jpegs)], dtype=np.int64)
    return Thumbnails(np.frombuffer(b"".join(jpegs), np.uint8), ends)
