"""Makes panoramas small enough to be kept of every frame."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.image import Panorama, Windows

from .panorama_snapshot import EncodedPanorama, small_image


class SmallPanorama(Stage):
    """Encodes the panorama or the windows of every frame as a small JPEG (quality 70).

    It is a stage of its own so that it can be cached with the log's other features: a stage that needs the panorama
    itself makes every run read and unwarp all images again.
    """

    columns: Annotated[int, Bounds(ge=0, le=8192)] = 360
    """Largest width (px); some 10 kB an image at 360; 0: none are kept."""

    class Out(Outputs):
        panorama: EncodedPanorama | None = None

    def step(self, ctx: Context, panorama: Panorama | Windows) -> Out:
        if not self.columns:
            return self.Out()
        small, headings = small_image(panorama, self.columns)
        return self.Out(panorama=EncodedPanorama(small.jpeg(70), headings))
