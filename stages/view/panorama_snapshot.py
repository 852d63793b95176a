"""A few panoramas as small encoded pictures, because images themselves are too large to be kept."""

import cv2

from omninav.pipeline import Context, Outputs, Stage, Tick, Value
from omninav.stages.values.image import Panorama

from .moments import is_moment


class EncodedPanorama(Value):
    """A panorama as JPEG bytes. Columns as in `Panorama`: clockwise, forward in the middle."""

    jpeg: bytes


class PanoramaSnapshot(Stage):
    """Encodes the panorama at frames 0, 1, 2, 5, 10, 20, 50, …; JPEG quality 90, at most 720 columns."""

    class Out(Outputs):
        """`snapshot`: absent at all other frames."""

        snapshot: EncodedPanorama | None = None

    def step(self, ctx: Context, tick: Tick, panorama: Panorama) -> Out:
        """One frame."""
        if not is_moment(tick.frame):
            return self.Out()
        pixels: cv2.typing.MatLike = panorama.pixels
        if pixels.shape[1] > 720:
            size = (720, max(1, round(pixels.shape[0] * 720 / pixels.shape[1])))
            pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
        _, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 90])
        return self.Out(snapshot=EncodedPanorama(jpeg.tobytes()))
