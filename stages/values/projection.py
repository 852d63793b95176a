"""A projection learned from images."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value


class Projection(Value):
    """The rows of a projection of images: y = W z. `components`: (D, P) float32, orthonormal, strongest first.

    An image z is a strip of P numbers, column by column around the robot. `explained`: (D,) the share of the training
    images' variance along each row.
    """

    components: npt.NDArray[np.float32]
    explained: npt.NDArray[np.float64]
