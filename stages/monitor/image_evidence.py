"""Keeps the evidence of each image for or against the estimate."""

import math
from dataclasses import field

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.visual_compass import turns_and_correlations
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.evidence import ImageEvidence, MatchLeads
from omninav.stages.values.image import Strip
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph

WHITE = 255.0
"""Grey of a white pixel."""


class MeasureEvidenceState(State):
    """`strip` (1, rows, columns): the image before; of no rows before the first."""

    strip: Floats = field(default_factory=lambda: np.zeros((1, 0, 0), np.float32))


class MeasureEvidence(Stage):
    """Measures the evidence of each image by itself on the estimate, for `omninav explain`; it changes no estimate.

    Best matches and leads are those of `ConfidenceMonitor`, landmarks those of `LandmarkPose`.
    """

    class Out(Outputs):
        evidence: ImageEvidence

    def step(
        self,
        ctx: Context,
        before: MeasureEvidenceState,
        estimate: PoseEstimate,
        map: ReferenceGraph,
        length_scale: LengthScale,
        leads: MatchLeads | None = None,
        strip: Strip | None = None,
        conflicts: Conflicts | None = None,
        fix: LandmarkFix | None = None,
        features: LocalFeatures | None = None,
    ) -> Out:
        """One image, or a tick without one."""
        pose = np.array(pose_row(estimate.pose))
        found: dict[str, float] = {}
        if len(map):
            found["nearest_m"] = float(np.hypot(*(map.poses[:, :2] - pose[:2]).T).min())
            found["nearest_scales"] = found["nearest_m"] / length_scale.metres
        if leads is not None:
            found["match_away_m"] = math.dist(leads.place[:2], pose[:2])
            found["match_lead"] = leads.over_elsewhere
            found["lead_against"] = leads.over_estimate
        if strip is not None:
            pixels = strip.pixels[None]
            found["brightness"] = min(1.0, float(pixels.mean()) / WHITE)
            found["contrast"] = min(1.0, float(pixels.std()) / WHITE)
            if before.strip.shape == pixels.shape and not ctx.tick.first_of_log:
                found["correlation"] = turns_and_correlations(np.concatenate([before.strip, pixels]))[1][0]
            before.strip = pixels
        if fix is not None:
            found["landmarks_away_m"] = math.dist(fix.poses[0, :2], pose[:2])
        looked = features is not None and map.landmarks is not None
        return self.Out(
            evidence=ImageEvidence(
                **found,
                landmarks=int(fix.inliers[0]) if fix is not None else 0 if looked else None,
                features=None if features is None else len(features),
                conflict="" if conflicts is None or not conflicts.misleading else conflicts.standing[0],
            )
        )
