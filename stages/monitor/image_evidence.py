"""Keeps what each image says for or against the estimate."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.visual_compass import turns_and_correlations
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.evidence import ImageEvidence
from omninav.stages.values.image import Strip
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Similarities

from .confidence_monitor import ELSEWHERE, best_place, lead_of_best, lead_over_pose

WHITE = 255.0
"""Grey of a white pixel."""


class MeasureEvidenceState(State):
    """`strip` (1, rows, columns): the image before; of no rows before the first."""

    strip: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros((1, 0, 0), np.float32))


class MeasureEvidence(Stage):
    """Measures what each image by itself says of the estimate, for `omninav explain`; it changes no estimate.

    Best matches and leads are those of `ConfidenceMonitor`, landmarks those of `LandmarkPose`.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Distance (m) by which an estimate may be off: `ConfidenceMonitor`'s."""

    class Out(Outputs):
        """The evidence of one image."""

        evidence: ImageEvidence

    def step(
        self,
        ctx: Context,
        before: MeasureEvidenceState,
        estimate: PoseEstimate,
        map: ReferenceGraph,
        length_scale: LengthScale,
        similarities: Similarities | None = None,
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
        if similarities is not None and similarities.values.size:
            gate = ELSEWHERE * max(self.within_m, length_scale.metres)
            found["match_away_m"] = math.dist(best_place(similarities, map)[:2], pose[:2])
            found["match_lead"] = lead_of_best(similarities, map, gate)
            found["lead_against"] = max(0.0, lead_over_pose(similarities, map, pose, gate))
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
