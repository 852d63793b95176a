"""SIFT that a view from the side does not change: the rival that is slower."""

from typing import Literal

import cv2

from omninav.pipeline import Context
from omninav.stages.values.image import Pixels

from .rotation_reduced_sift import RotationReducedSift


class AffineSift(RotationReducedSift):
    """Features invariant to affine changes, with the colours of each patch: OpenCV's ASIFT (Yu & Morel 2011).

    Of the image and of 42 tilted and turned ones of it. Goedemé et al. 2007, section 2.1.2, call affine-invariant
    features too slow for a robot, and mean earlier ones (Tuytelaars & Van Gool, Matas, Mikolajczyk & Schmid). Raises
    BadInput for an image without a camera.
    """

    orientation: Literal["reduced", "own"] = "own"
    """Its features turn by themselves."""

    def setup(self, ctx: Context) -> None:
        super().setup(ctx)
        self._affine = cv2.AffineFeature.create(self._sift)

    def _detected(self, sift: cv2.SIFT, grey: Pixels, mask: Pixels | None) -> list[cv2.KeyPoint]:
        return self._with_rows(*self._affine.detectAndCompute(grey, mask))
