"""The colours of a view as a whole."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import GlobalDescriptor

from .colour_moments import picture_colours
from .prepared_image import read_picture


class GlobalColours(Stage):
    """Colour correlations of a whole view, which light does not change: unlike views differ at a glance.

    Goedeme et al. 2007, section 4.2.1: the moments of equation 1 (erratum 25) over all of a panorama, or over the ring
    of a mirror image. Raises BadInput for an image without a camera.
    """

    largest: Annotated[int, Bounds(ge=1024)] = 76800

    class Out(Outputs):
        """Three correlations."""

        descriptor: GlobalDescriptor

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        """Describe one picture."""
        read = read_picture(image, camera, self.largest)
        return self.Out(descriptor=GlobalDescriptor(picture_colours(read.pixels, read.seen)))
