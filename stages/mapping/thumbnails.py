"""Small pictures of a map's references or views, for people: the map itself holds none."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Tick, Value
from omninav.stages.camera.model import Camera
from omninav.stages.camera.thumbnail import thumbnail
from omninav.stages.values.image import Image, Panorama, Windows
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.thumbnails import Thumbnails
from omninav.stages.values.topological_map import TopologicalMap


class ReferenceThumbnails(Value):
    """Pictures of the references that a tick added to a map, as JPEG bytes, in the map's order."""

    jpegs: tuple[bytes, ...]


class ThumbnailsState(State):
    """How many references have their picture."""

    references: int = 0


class ReferenceSnapshot(Stage):
    """Encodes the pictures of references as they come into a map: JPEG, at most `columns` wide.

    A panorama is one reference, of windows each is one. Read the map behind the stage that adds to it.
    """

    columns: Annotated[int, Bounds(ge=16)] = 160
    quality: Annotated[int, Bounds(ge=1, le=100)] = 75

    class Out(Outputs):
        """`pictures`: absent where the map did not grow."""

        pictures: ReferenceThumbnails | None = None

    def step(self, ctx: Context, panorama: Panorama | Windows, map: ReferenceGraph, thumbnails: ThumbnailsState) -> Out:
        """One tick."""
        if len(map) <= thumbnails.references:
            return self.Out()
        seen = list(panorama.pixels) if isinstance(panorama, Windows) else [panorama.pixels]
        new = len(map) - thumbnails.references
        thumbnails.references = len(map)
        jpegs = (thumbnail(pixels, None, self.columns).jpeg(self.quality) for pixels in seen[:new])
        return self.Out(pictures=ReferenceThumbnails(tuple(jpegs)))


class CollectThumbnails(Stage):
    """Binds the pictures of all references into an album, which is kept in a file of its own."""

    class Out(Outputs):
        """A picture per reference of the map."""

        thumbnails: Thumbnails

    def step(self, ctx: Context, pictures: Sequence[ReferenceThumbnails]) -> Out:
        """The whole tour at once."""
        return self.Out(thumbnails=bound([jpeg for some in pictures for jpeg in some.jpegs]))


class TourSnapshot(Stage):
    """Encodes every picture of a tour: JPEG, at most `columns` wide; of a mirror's or a lens's picture the disc.

    Which of them a map keeps is only known at its end.
    """

    columns: Annotated[int, Bounds(ge=16)] = 240
    quality: Annotated[int, Bounds(ge=1, le=100)] = 75

    class Out(Outputs):
        """One picture."""

        pictures: ReferenceThumbnails

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        """One tick."""
        jpeg = thumbnail(image.pixels, camera, self.columns).jpeg(self.quality)
        return self.Out(pictures=ReferenceThumbnails((jpeg,)))


class ViewThumbnails(Stage):
    """Binds the pictures of a topological map's views into an album; those of a `known` map's views are not known."""

    class Out(Outputs):
        """A picture per view of the map."""

        thumbnails: Thumbnails

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        pictures: Sequence[ReferenceThumbnails | None],
        map: TopologicalMap,
        known: TopologicalMap | None = None,
    ) -> Out:
        """The whole tour at once; `ticks` are counted on from the known map's frames."""
        first = 0 if known is None or not len(known.frames) else 1 + int(known.frames.max())
        rows = (map.frames - first).tolist()
        found = [pictures[row] if row >= 0 else None for row in rows]
        return self.Out(thumbnails=bound([b"" if some is None else some.jpegs[0] for some in found]))


def bound(jpegs: Sequence[bytes]) -> Thumbnails:
    """Pictures as an album; an empty one stands for a picture that is not known."""
    ends = np.cumsum([0, *(len(jpeg) for jpeg in jpegs)], dtype=np.int64)
    return Thumbnails(np.frombuffer(b"".join(jpegs), np.uint8), ends)
