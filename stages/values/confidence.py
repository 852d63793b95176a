"""Confidence in an estimate."""

from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Value
from omninav.pipeline.graph.contents import Shape

Probability = Annotated[float, Bounds(ge=0, le=1)]


class PoseConfidence(Value):
    """The probability that the estimate is right, within a tolerance in position and heading."""

    probability: Probability


class WrongPoseAgreement(Value):
    """Share in [0, 1] of the map's images whose best match lies where a robot wrongly believes to be."""

    costly: ClassVar[bool] = True

    share: Probability


class ConfidenceReliability(Value):
    """Frames by their confidence, in bins: the mean confidence `stated` (B,), the share `observed` (B,) of estimates
    that were within the tolerance (`within_m`, `within_deg`), and `counts` (B,), how many frames there are.
    """

    stated: Annotated[npt.NDArray[np.float64], Shape("B"), Bounds(ge=0, le=1)]
    observed: Annotated[npt.NDArray[np.float64], Shape("B"), Bounds(ge=0, le=1)]
    counts: Annotated[npt.NDArray[np.int64], Shape("B"), Bounds(ge=1)]
    within_m: Annotated[float, Bounds(gt=0)]
    within_deg: Annotated[float, Bounds(gt=0)]
