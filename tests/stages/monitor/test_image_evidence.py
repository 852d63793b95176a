import numpy as np
import pytest
from landmark_tour import graph_of

from omninav.pipeline import Context, Tick
from omninav.stages.monitor.image_evidence import MeasureEvidence, MeasureEvidenceState
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.evidence import MatchLeads
from omninav.stages.values.image import Strip
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Pose

POSE = Pose(10.0, 2.0, 0.0)
MAP = graph_of(np.column_stack([np.linspace(-10.0, 10.0, 41), np.zeros((41, 2))]))


def measured(state, tick=1, **inputs):
    ctx = Context("evidence")
    ctx.tick = Tick(tick, tick, first_of_log=tick == 0)
    estimate = PoseEstimate(POSE, np.eye(3), 0.9, POSE)
    return MeasureEvidence().step(ctx, state, estimate, MAP, LengthScale(0.5), **inputs).evidence


def test_an_image_is_measured_beside_the_estimate():
    fix = LandmarkFix(np.array([[10.0, 2.3, 0.0]]), np.eye(3)[None], np.array([40]), np.array([0.9]), 50)
    found = measured(MeasureEvidenceState(), leads=MatchLeads(np.array([-8.0, 0.0, 0.0]), 3.0, 1.5), fix=fix)
    assert found.nearest_m == pytest.approx(2.0)
    assert found.nearest_scales == pytest.approx(4.0)
    assert found.match_away_m == pytest.approx(np.hypot(18.0, 2.0))
    assert (found.match_lead, found.lead_against) == (3.0, 1.5)
    assert (found.landmarks, found.landmarks_away_m) == (40, pytest.approx(0.3))
    assert (found.features, found.brightness, found.conflict) == (None, None, "")


def test_images_are_compared_with_the_one_before_of_their_log():
    state, grey = MeasureEvidenceState(), np.random.default_rng(0).uniform(0.0, 255.0, (8, 90)).astype(np.float32)
    first, turned, dark, next_log = (
        measured(state, tick, strip=Strip(pixels))
        for tick, pixels in ((0, grey), (1, np.roll(grey, 9, axis=1)), (2, 0.0 * grey), (0, grey))
    )
    assert (first.correlation, next_log.correlation) == (None, None)
    assert turned.correlation == pytest.approx(1.0, abs=1e-5)
    assert (dark.correlation, dark.brightness, dark.contrast) == (0.0, 0.0, 0.0)
    assert first.brightness == pytest.approx(0.5, abs=0.02)
    assert first.contrast == pytest.approx(12**-0.5, abs=0.02)


def test_a_finding_that_misleads_is_kept_while_it_stands():
    for misleading, kept in ((True, "the clock leaps"), (False, "")):
        conflicts = Conflicts(("the clock leaps",), ("the clock leaps",), misleading)
        assert measured(MeasureEvidenceState(), conflicts=conflicts).conflict == kept
