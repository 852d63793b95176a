import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.fusion.agreement import Agreement
from omninav.stages.metrics.resampling_spread import ResamplingSpread, agreement
from omninav.stages.values.belief import GaussianMixture, Particles

CTX = Context("metric")


def cloud(sigma: float, at: float = 0.0) -> Particles:
    poses = np.random.default_rng(3).normal([at, 0.0, 0.0], [sigma, sigma, 0.1], (4000, 3))
    return Particles(poses, np.full(4000, 1 / 4000))


def seen(sigma: float) -> GaussianMixture:
    return GaussianMixture(np.zeros((1, 3)), np.diag([sigma, sigma, 0.2])[None] ** 2, np.array([0.5]))


def test_resampling_concentrates_where_both_agree():
    before, hypothesis = cloud(1.0), seen(1.0)
    after = Agreement().step(Context("fusion", np.random.default_rng(1)), before, hypothesis).belief
    found = ResamplingSpread().step(CTX, [before, before], [hypothesis, None], [after, before]).metrics.values
    # The product of two Gaussians of equal variance has half of it.
    assert found["resampling"]["frames"] == 1
    assert found["resampling"]["ratio"] == pytest.approx(np.sqrt(0.5), abs=0.03)


def test_frames_in_which_they_disagree_do_not_count():
    far = cloud(0.1, at=50.0)
    assert agreement(far, seen(1.0)) < 1e-4
    assert ResamplingSpread().step(CTX, [far], [seen(1.0)], [far]).metrics.values == {"resampling": {"frames": 0}}
