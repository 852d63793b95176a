"""How far an estimate is to be trusted."""

from typing import Annotated, ClassVar

from omninav.pipeline import Bounds, Value

Probability = Annotated[float, Bounds(ge=0, le=1)]


class PoseConfidence(Value):
    """The probability that the estimate is right, within a tolerance in position and heading."""

    probability: Probability


class WrongPoseAgreement(Value):
    """How often the best match of an image of the map lies where a robot wrongly believes to be: a share in [0, 1]."""

    costly: ClassVar[bool] = True

    share: Probability
