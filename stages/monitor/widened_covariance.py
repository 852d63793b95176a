"""Widens the covariance of an estimate to the errors that were measured."""

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.drive import pose_row
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

Array = npt.NDArray[np.float64]


class WidenCovariance(Stage):
    """Widens the covariance of a particle filter's mode, which is too sure, to the errors that were measured.

    The filter takes images for independent, and where the robot drives beside the mapped path they agree on an estimate
    that is off by a share of the appearance length scale, which no particle shows. So that share of the map's length
    scale, squared, is added to both variances of the position. While the estimate is more probably wrong than right,
    the robot may be anywhere in the map: the covariance is that of the map's references about the estimate, and of any
    heading. How well it holds, and where the share is from: docs/experiments/confidence.md.
    """

    floor: Annotated[float, Bounds(ge=0)] = 0.6
    """Standard deviation of the error that particles do not show, in each direction, in length scales of the map:
    the larger, the wider the covariance."""
    min_confidence: Annotated[float, Bounds(ge=0, le=1)] = 0.5
    """Confidence below which the covariance covers the whole map; 0: never."""

    class Out(Outputs):
        """The estimate with the covariance that leaves the system."""

        estimate: PoseEstimate

    def step(
        self,
        ctx: Context,
        estimate: PoseEstimate,
        confidence: PoseConfidence,
        length_scale: LengthScale,
        map: ReferenceGraph,
    ) -> Out:
        """One estimate."""
        variance = (self.floor * length_scale.metres) ** 2
        covariance = estimate.covariance.copy()
        covariance[0, 0] += variance
        covariance[1, 1] += variance
        if confidence.probability < self.min_confidence:
            covariance = covariance + map_covariance(np.array(pose_row(estimate.pose)), map)
        return self.Out(estimate=replace(estimate, covariance=covariance))


def map_covariance(pose: Array, map: ReferenceGraph) -> Array:
    """The covariance (3, 3) about a pose (3,) of a robot that stands at any reference, turned anyhow."""
    covariance = np.zeros((3, 3))
    if len(map):
        away = map.poses[:, :2] - pose[:2]
        covariance[:2, :2] = away.T @ away / len(away)
    covariance[2, 2] = math.pi**2 / 3.0
    return covariance
