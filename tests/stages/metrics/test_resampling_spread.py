import numpy as np
import pytest
from measured_drives import figures

from omninav.stages.metrics.resampling_spread import ResamplingSpread, agreement
from omninav.stages.values.belief import GaussianMixture, Particles


def spread(before, hypotheses, after):
    return figures(ResamplingSpread(), before, hypotheses, after)["resampling"]


def seen(sigma: float) -> GaussianMixture:
    return GaussianMixture(np.zeros((1, 3)), np.diag([sigma, sigma, 0.2])[None] ** 2, np.array([0.5]))


def two(x: float, y: float, heading: float = 0.0) -> Particles:
    """Two particles of equal weight: the spread is the root of x squared and y squared."""
    return Particles(np.array([(x, y, heading), (-x, -y, -heading)]), np.full(2, 0.5))


def test_spreads_are_means_over_the_frames_and_the_ratio_is_theirs():
    frames = [(two(0.3, 0.4, 0.2), two(0.0, 0.25)), (two(0.6, 0.8), two(0.6, 0.45)), (two(0.0, 0.3), two(0.2, 0.0))]
    before, after = zip(*frames, strict=True)
    assert spread(before, [seen(1.0)] * 3, after) == {
        "frames": 3,
        "before_m": pytest.approx(0.6),
        "after_m": pytest.approx(0.4),
        "ratio": pytest.approx(2 / 3),
    }


def test_mixtures_and_frames_without_a_hypothesis_are_left_out_and_a_hypothesis_counts_by_its_shape():
    near = two(0.1, 0.0)
    assert spread([seen(1.0), near, near, near], [*[seen(1.0)] * 3, None], [near, seen(1.0), near, near])["frames"] == 1
    light = GaussianMixture(np.zeros((2, 3)), np.stack([np.eye(3)] * 2), np.array([0.1, 0.3]))
    assert agreement(two(0.0, 0.0), light) == pytest.approx((2 * np.pi) ** -1.5)


def test_they_agree_above_a_density_of_a_ten_thousandth():
    def frames(away: float) -> int:
        near = Particles(np.array([(away, 0.001, 0.0), (away, -0.001, 0.0)]), np.full(2, 0.5))
        unit = GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1))
        return spread([near], [unit], [near])["frames"]

    limit = np.sqrt(2 * np.log((2 * np.pi) ** -1.5 / 1e-4))
    assert [frames(limit - 0.001), frames(limit + 0.001)] == [1, 0]


def test_at_the_limit_itself_they_do_not_agree(monkeypatch: pytest.MonkeyPatch):
    near, there = two(0.1, 0.0), seen(1.0)
    monkeypatch.setattr("omninav.stages.metrics.resampling_spread.AGREE_ABOVE", agreement(near, there))
    assert spread([near], [there], [near]) == {"frames": 0}
