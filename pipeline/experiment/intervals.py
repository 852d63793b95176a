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
    """95 % interval of the mean over all values, by resampling groups with all their values (always the same).

    `groups`: the values (n_g,) of each scenario; of one, its values are resampled. With `over`, values of the same
    shapes: that of the ratio of the two means, resampled in pairs. Equal values, or a single one, give an interval of
    no width. Of two to five scenarios it is Student's t of their means.

    The means of groups vary as their values do already: values that are resampled too count that twice, and 95 % become
    99 (Davison & Hinkley, Bootstrap Methods and their Application, 1997, section 3.8). The percentiles are expanded
    (Hesterberg, What Teachers Should Know About the Bootstrap, 2015), because those of a plain bootstrap are too narrow
    where there are few groups: by sqrt((n - 1) / n), and by the normal in place of Student's t.
    """
    columns = [[group for group in column if len(group)] for column in ((groups,) if over is None else (groups, over))]
    whole = [np.concatenate(column) for column in columns]
    if all(np.ptp(values) == 0.0 for values in whole):
        mean = float(whole[0][0]) if over is None else float(_ratios(whole[0], whole[1])[0])
        return mean, mean
    if over is None and 1 < len(columns[0]) < MIN_GROUPS:
        return student_interval([float(group.mean()) for group in columns[0]])
    units = columns if len(columns[0]) > 1 else [np.split(values, len(values)) for values in whole]
    number = len(units[0])
    drawn = np.random.default_rng(0).integers(number, size=(RESAMPLES, number))
    sums = [np.array([unit.sum() for unit in column])[drawn].sum(axis=1) for column in units]
    values = sums[0] / np.array([len(unit) for unit in units[0]])[drawn].sum(axis=1) if over is None else _ratios(*sums)
    shares = _expanded(number)
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


def _expanded(independent: int) -> tuple[float, float]:
    """The two percentiles, as shares, for this many independent values."""
    tail = (1.0 - CONFIDENCE) / 2.0
    share = float(ndtr(np.sqrt(independent / (independent - 1)) * stdtrit(independent - 1, tail)))
    return share, 1.0 - share
