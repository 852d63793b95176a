"""Intervals of means over a hierarchy, scenarios first and then repetitions in each of them, and of shares of runs."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtrit

Array = npt.NDArray[np.float64]

RESAMPLES = 4999
CONFIDENCE = 0.95
MIN_GROUPS = 6
"""Groups from which on they are resampled: of fewer no resample is outside the values, which enclose the mean less
often than 95 % of the times (of five, 94 %; of two, half)."""


def bootstrap_interval(groups: Sequence[Array], over: Sequence[Array] | None = None) -> tuple[float, float]:
    """95 % interval of the mean over all values, by resampling groups and then the values in each (always the same).

    `groups`: the values (n_g,) of each scenario. With `over`, values of the same shapes: that of the ratio of the two
    means, resampled in pairs. Equal values, or a single one, give an interval of no width. Of two to five scenarios it
    is Student's t of their means.

    The two-stage bootstrap of hierarchical data (Davison & Hinkley, Bootstrap Methods and their Application, 1997). Its
    percentiles are expanded (Hesterberg, What Teachers Should Know About the Bootstrap, 2015), because those of a plain
    one are too narrow where there are few groups: by sqrt((n - 1) / n), and by the normal in place of Student's t.
    """
    columns = [[group for group in column if len(group)] for column in ((groups,) if over is None else (groups, over))]
    whole = [np.concatenate(column) for column in columns]
    if all(np.ptp(values) == 0.0 for values in whole):
        mean = float(whole[0][0]) if over is None else float(_ratios(whole[0], whole[1])[0])
        return mean, mean
    counts = [len(group) for group in columns[0]]
    if over is None and 1 < len(counts) < MIN_GROUPS:
        return student_interval([float(group.mean()) for group in columns[0]])
    drawn, there = _draws(counts)
    sums = [np.sum(_padded(column)[drawn], axis=(1, 2), where=there) for column in columns]
    values = sums[0] / there.sum(axis=(1, 2)) if over is None else _ratios(*sums)
    independent = len(counts) if len(counts) > 1 else counts[0]
    shares = _expanded(independent)
    if np.isfinite(values).all():
        low, high = np.quantile(values, shares)
    else:  # between infinite values there is nothing
        low, high = np.quantile(values, shares, method="nearest")
    return float(low), float(high)


def share_interval(met: int, of: int) -> tuple[float, float]:
    """95 % interval (Wilson's) of a share of runs: `met` of `of`."""
    from scipy.stats import binomtest  # type: ignore[attr-defined]

    interval = binomtest(met, of).proportion_ci(CONFIDENCE, method="wilson")
    return float(interval.low), float(interval.high)


def student_interval(means: Sequence[float]) -> tuple[float, float]:
    """95 % interval of the mean of a few independent values."""
    half = float(stdtrit(len(means) - 1, (1.0 + CONFIDENCE) / 2.0)) * float(np.std(means, ddof=1)) / len(means) ** 0.5
    middle = float(np.mean(means))
    return middle - half, middle + half


def _ratios(of: Array, over: Array) -> Array:
    """Ratios of sums, where nothing over nothing is one and something over nothing infinite."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((of == 0.0) & (over == 0.0), 1.0, of / over)


def _draws(counts: Sequence[int]) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Places in the padded values that each resample draws (RESAMPLES, groups, n), and which of them count."""
    rng, number, longest = np.random.default_rng(0), len(counts), max(counts)
    of_group = np.asarray(counts)
    group = rng.integers(number, size=(RESAMPLES, number))
    place = (rng.random((RESAMPLES, number, longest)) * of_group[group][..., None]).astype(np.intp)
    return group[..., None] * longest + place, np.arange(longest) < of_group[group][..., None]


def _padded(groups: Sequence[Array]) -> Array:
    longest = max(len(group) for group in groups)
    return np.concatenate([np.pad(group, (0, longest - len(group))) for group in groups])


def _expanded(independent: int) -> tuple[float, float]:
    """The two percentiles, as shares, for this many independent values."""
    tail = (1.0 - CONFIDENCE) / 2.0
    share = float(ndtr(np.sqrt(independent / (independent - 1)) * stdtrit(independent - 1, tail)))
    return share, 1.0 - share
