"""The first image of a log, for homing that compares whole images."""

from omninav.pipeline import Context, Outputs, Stage, Tick
from omninav.stages.values.image import Image, Panorama


class FirstImage(Stage):
    """The image with which a log begins, once; its reader holds it: `{from: first_image.image, hold: true}`."""

    class Out(Outputs):
        """Absent at all other images."""

        image: Image | Panorama | None = None

    def step(self, ctx: Context, tick: Tick, image: Image | Panorama) -> Out:
        """The image, where it is the log's first."""
        return self.Out(image=image if tick.first_of_log else None)
