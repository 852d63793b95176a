"""Learns from a map's own images how often a wrong estimate looks right."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.segments import HEADINGS, similarities
from omninav.stages.geometry.appearance.visual_compass import angle_of_peak
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.confidence import WrongPoseAgreement
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph

from .consistency import consistency

MAX_COMPARED = 10_000
"""References of a larger map that an image is compared with, evenly spaced."""
SAMPLES = 100
"""Images of the map, evenly spaced, that are taken out of it."""
MIN_SHARE = 0.005
"""Smallest share that so few images can tell."""


class LearnWrongPoseAgreement(Stage):
    """Puts a robot at wrong places of the map, and looks how often an image's best match agrees with them.

    Sample images of the map are compared with those that are farther away than a length scale, so that each is new to
    the map. Wrong poses are those of all other images outside the tolerance. Nothing but the map is needed: views are
    compared by their best segments (`match=selective`), whatever the variant compares by. Manifest fact
    `wrong_pose_agreement`.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Tolerance in position (m), as the monitor's."""
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 10.0
    """Tolerance in heading, as the monitor's."""

    class Out(Outputs):
        when_wrong: WrongPoseAgreement

    def step(self, ctx: Context, map: ReferenceGraph, length_scale: LengthScale) -> Out:
        number, radians = len(map), math.radians(self.within_deg)
        samples = np.unique(np.linspace(0, number - 1, min(SAMPLES, number)).astype(np.int64))
        others = np.unique(np.linspace(0, number - 1, min(MAX_COMPARED, number)).astype(np.int64))
        poses, views = map.poses[others], map.features[others]
        gate = max(self.within_m, length_scale.metres)
        shares = []
        for pose, view in zip(map.poses[samples], map.features[samples], strict=True):
            away = np.hypot(*(poses - pose)[:, :2].T)
            turned = np.abs(wrap(poses[:, 2] - pose[2]))
            far, wrong = away > length_scale.metres, (away > self.within_m) | (turned > radians)
            if not (far.any() and wrong.any()):
                continue
            values = similarities(views[far], view, HEADINGS, map.kind)
            best = int(values.max(axis=1).argmax())
            match = poses[far][best] + (0.0, 0.0, angle_of_peak(values[best]))
            shares.append(float(consistency(poses[wrong], match, gate, radians).mean()))
        share = max(MIN_SHARE, float(np.mean(shares)) if shares else 0.0)
        ctx.fact("wrong_pose_agreement", round(share, 4))
        return self.Out(when_wrong=WrongPoseAgreement(min(share, 0.5)))
