"""A projection learned from images."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value
from omninav.pipeline.graph.contents import Shape


class Projection(Value):
    """The rows of a projection of images: y = W z. `components`: (D, P) float32, orthonormal, strongest first.

    An image z is a strip of P numbers, column by column around the robot. `explained`: (D,) the share of the training
    images' variance along each row.
    """

    components: Annotated[npt.NDArray[np.float32], Shape("D", "P")]
    explained: Annotated[npt.NDArray[np.float64], Shape("D")]
