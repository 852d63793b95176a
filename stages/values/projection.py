"""A projection learned from images."""

from typing import Annotated

from omninav.pipeline import Shape, Value
from omninav.stages.geometry.arrays import Array, Floats


class Projection(Value):
    """The rows of a projection of images: y = W z. `components`: (D, P) float32, orthonormal, strongest first.

    An image z is a strip of P numbers, column by column around the robot. `explained`: (D,) the share of the training
    images' variance along each row.
    """

    components: Annotated[Floats, Shape("D", "P")]
    explained: Annotated[Array, Shape("D")]
