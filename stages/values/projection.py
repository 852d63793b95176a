"""A projection of pictures that was learned from pictures."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value


class Projection(Value):
    """Rows that pictures are projected on: y = W z. `components`: (D, P) float32, orthonormal, strongest first.

    A picture z is a strip of P numbers, column by column around the robot. `explained`: (D,) the share of the learning
    pictures' variance along each row.
    """

    components: npt.NDArray[np.float32]
    explained: npt.NDArray[np.float64]
