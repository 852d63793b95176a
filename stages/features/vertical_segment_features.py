"""Column segments as a view's only local features."""

from dataclasses import replace
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.local_features import LocalFeatures

from .rotation_reduced_sift import none_found
from .vertical_segments import FindVerticalSegments


class VerticalSegmentFeatures(Stage):
    """Describes a view by invariant column segments alone, without patches, to measure what these contribute.

    Goedemé et al. 2007, sections 3.3 and 3.4. Raises BadInput for an image without a camera.
    """

    max_pixels: Annotated[int, Bounds(ge=1024)] = 76800
    """Larger images are made smaller; 320 x 240 is the paper's size."""

    class Out(Outputs):
        """Columns, and no patches; there may be no columns either."""

        features: LocalFeatures

    def setup(self, ctx: Context) -> None:
        self._columns = FindVerticalSegments(max_pixels=self.max_pixels)

    def step(self, ctx: Context, image: Image | Panorama, camera: Camera | None = None) -> Out:
        found = self._columns.step(ctx, image, camera).vertical_segments
        return self.Out(features=replace(none_found(), columns=found))
