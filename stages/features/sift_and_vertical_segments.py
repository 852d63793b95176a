"""Both kinds of local features: SIFT for a robot on a floor, and columns between two edges."""

from dataclasses import replace

from omninav.pipeline import Context
from omninav.stages.camera.model import Camera
from omninav.stages.values.image import Image, Panorama
from omninav.stages.values.own_body import OwnBody

from .rotation_reduced_sift import RotationReducedSift
from .vertical_segments import FindVerticalSegments


class SiftAndVerticalSegments(RotationReducedSift):
    """Rotation-reduced SIFT with colours, and invariant column segments, which complement each other.

    Goedemé et al. 2007, sections 3.2 to 3.4: map, localisation and homing use both. Raises BadInput for an image
    without a camera.
    """

    def setup(self, ctx: Context) -> None:
        super().setup(ctx)
        self._columns = FindVerticalSegments(max_pixels=self.max_pixels)

    def step(
        self, ctx: Context, image: Image | Panorama, camera: Camera | None = None, body: OwnBody | None = None
    ) -> RotationReducedSift.Out:
        patches = super().step(ctx, image, camera, body).features
        columns = self._columns.step(ctx, image, camera).vertical_segments
        return self.Out(features=replace(patches, columns=columns))
