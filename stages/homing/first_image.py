"""The first image of a log, for homing that compares whole images."""

from omninav.pipeline import Context, Outputs, Stage, State, Tick
from omninav.stages.values.image import Image, Panorama


class FirstImageState(State):
    """The log whose first image has been given."""

    log: int = -1


class FirstImage(Stage):
    """The image with which a log begins, once; its reader holds it: `{from: first_image.image, hold: true}`."""

    class Out(Outputs):
        """Absent at all other images."""

        image: Image | Panorama | None = None

    def step(self, ctx: Context, state: FirstImageState, tick: Tick, image: Image | Panorama) -> Out:
        """The image, where it is the log's first; that of its first tick may have been lost."""
        first, state.log = tick.log != state.log, tick.log
        return self.Out(image=image if first else None)
