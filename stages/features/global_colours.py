"""The colours of a view as a whole."""

from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import GlobalDescriptor

from .colour_moments import image_colours
from .prepared_image import prepared_image


class GlobalColours(Stage):
    """Describes a whole view by colour correlations that light does not change, to tell different views apart quickly.

    Goedemé et al. 2007, section 4.2.1: the moments of equation 1 (erratum 25 in docs/papers.md) over all of a panorama,
    or over the ring of a mirror image. Raises BadInput for an image without a camera.
    """

    max_pixels: Annotated[int, Bounds(ge=1024)] = 76800
    """Larger images are made smaller."""

    class Out(Outputs):
        """Three correlations."""

        descriptor: GlobalDescriptor

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        read = prepared_image(image, camera, self.max_pixels)
        return self.Out(descriptor=GlobalDescriptor(image_colours(read.pixels, read.seen)))
