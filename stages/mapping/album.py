"""Small pictures of a map's references, for people: the map itself holds none."""

from collections.abc import Sequence
from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State, Value
from omninav.stages.values.album import Album
from omninav.stages.values.image import Panorama, Pixels, Windows
from omninav.stages.values.maps import ReferenceGraph


class ReferencePictures(Value):
    """Pictures of the references that a tick added to a map, as JPEG bytes, in the map's order."""

    jpegs: tuple[bytes, ...]


class InAlbum(State):
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

        pictures: ReferencePictures | None = None

    def step(self, ctx: Context, panorama: Panorama | Windows, map: ReferenceGraph, album: InAlbum) -> Out:
        """One tick."""
        if len(map) <= album.references:
            return self.Out()
        seen = list(panorama.pixels) if isinstance(panorama, Windows) else [panorama.pixels]
        new = len(map) - album.references
        album.references = len(map)
        return self.Out(pictures=ReferencePictures(tuple(self._small(pixels) for pixels in seen[:new])))

    def _small(self, pixels: Pixels) -> bytes:
        small: cv2.typing.MatLike = pixels
        if pixels.shape[1] > self.columns:
            size = (self.columns, max(1, round(pixels.shape[0] * self.columns / pixels.shape[1])))
            small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, self.quality])
        return jpeg.tobytes()


class CollectAlbum(Stage):
    """Binds the pictures of all references into an album, which is kept in a file of its own."""

    class Out(Outputs):
        """A picture per reference of the map."""

        album: Album

    def step(self, ctx: Context, pictures: Sequence[ReferencePictures]) -> Out:
        """The whole tour at once."""
        jpegs = [jpeg for some in pictures for jpeg in some.jpegs]
        ends = np.cumsum([0, *(len(jpeg) for jpeg in jpegs)], dtype=np.int64)
        return self.Out(album=Album(np.frombuffer(b"".join(jpegs), np.uint8), ends))
