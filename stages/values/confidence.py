"""Confidence in an estimate."""

from typing import Annotated, ClassVar, Literal, get_args

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Ints

Probability = Annotated[float, Bounds(ge=0, le=1)]


TrackingState = Literal["searching", "tracking", "lost", "blind"]
"""States of a robot: `searching`, it does not know where it is since it began; `tracking`, it does; `lost`, it did;
`blind`, it does by odometry alone, as three images in a row are missing or show fewer than eight features (where
landmarks are looked for)."""
TRACKING_STATES: tuple[TrackingState, ...] = get_args(TrackingState)
"""All of them."""
SURE_STATES: tuple[TrackingState, ...] = ("tracking", "blind")
"""Those of a robot that knows where it is."""
MIN_SURE = 0.5
"""Probability from which on an estimate is rather right than wrong."""

MIN_SEEN, MIN_EMPTY = 8, 3
"""Features below which an image shows no landmarks at all, and such images in a row that make a robot blind."""


class PoseConfidence(Value):
    """The probability that the estimate is right, within a tolerance in position and heading, and what follows.

    `of_mode`: the probability that the robot is in the belief's mode whose pose was estimated, however wide that is.
    """

    probability: Probability
    state: TrackingState = "tracking"
    of_mode: Probability = 1.0

    @property
    def is_sure(self) -> bool:
        """Tells whether the robot knows where it is."""
        return self.state in SURE_STATES


class WrongPoseAgreement(Value):
    """Share in [0, 1] of the map's images whose best match is where a robot wrongly believes to be."""

    costly: ClassVar[bool] = True

    share: Probability


class ConfidenceReliability(Value):
    """Frames by their confidence, in bins: the mean confidence `stated` (B,), the share `observed` (B,) of estimates
    that were within the tolerance (`within_m`, `within_deg`), and `counts` (B,), how many frames there are.
    """

    stated: Annotated[Array, Shape("B"), Bounds(ge=0, le=1)]
    observed: Annotated[Array, Shape("B"), Bounds(ge=0, le=1)]
    counts: Annotated[Ints, Shape("B"), Bounds(ge=1)]
    within_m: Annotated[float, Bounds(gt=0)]
    within_deg: Annotated[float, Bounds(gt=0)]
