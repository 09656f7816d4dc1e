"""Metrics of many plans: success with its uncertainty, progress in time, profiles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import norm

from ferguson_gym.runtime.arrays import Array

CONFIDENCE = 0.95
"""Of intervals."""


class Interval(NamedTuple):
    """From where to where."""

    low: float
    high: float


def success_interval(successes: float, number: int) -> Interval:
    """Wilson's interval of the chance of success.

    Args:
        successes: Successful trials; a fraction where a trial is a mean over several seeds.
        number: Trials.

    Raises:
        ValueError: There are no trials, or more successes than trials.

    Reference:
        Wilson (1927), Probable inference, the law of succession, and statistical inference,
        Journal of the American Statistical Association 22.

    Example:
        >>> low, high = success_interval(99, 100)
        >>> round(low, 3), round(high, 3)
        (0.946, 0.998)
    """
    if not 0 <= successes <= number or number == 0:
        raise ValueError(f"need at least one attempt, got {successes} successes of {number}")
    # scipy.stats.binomtest has the same interval, but for whole numbers alone
    share, z = successes / number, float(norm.ppf(0.5 + CONFIDENCE / 2.0))
    middle = (share + z * z / (2.0 * number)) / (1.0 + z * z / number)
    half = z / (1.0 + z * z / number)
    half *= math.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number**2))
    # rounding would move the ends beyond 0 and 1 by the last digit
    return Interval(0.0 if share == 0.0 else middle - half, 1.0 if share == 1.0 else middle + half)


def path_share(success: ArrayLike, length: ArrayLike, exact: ArrayLike | None) -> Array:
    """A flight's part in SPL: exact / max(length, exact) [m] if it arrived, else 0.

    Args:
        success: (n,) or a single value; likewise the next two.
        length: Length flown [m].
        exact: Length of the shortest path [m]; None or NaN where none is known, which counts 0.

    Reference:
        Anderson et al. (2018), On evaluation of embodied navigation agents, arXiv:1807.06757.

    Example:
        >>> path_share([True, False], [150.0, 20.0], [144.0, None]).tolist()
        [0.96, 0.0]
    """
    shortest = np.asarray(exact, float)
    share = shortest / np.maximum(np.asarray(length, float), shortest)
    return np.where(np.asarray(success, bool) & np.isfinite(share), share, 0.0)


def best_so_far(progress: Sequence[tuple[float, float]], seconds: ArrayLike) -> Array:
    """The best length at given times: (n,) [m], infinite before the first.

    Args:
        progress: seconds and the length [m] reached then, in order of time.
        seconds: (n,).
    """
    at = np.array([when for when, _ in progress])
    best = np.minimum.accumulate([np.inf, *(length for _, length in progress)])
    return np.asarray(best[np.searchsorted(at, np.asarray(seconds), side="right")])


def share_within(values: Sequence[float | None], levels: ArrayLike) -> Array:
    """Share of values that are at most each level: (n,) in [0, 1]; None is never.

    With gaps this is a performance profile.

    Reference:
        Dolan & Moré (2002), Benchmarking optimization software with performance profiles,
        Mathematical Programming 91.
    """
    known = np.sort([value for value in values if value is not None])
    return np.searchsorted(known, np.asarray(levels), side="right") / max(1, len(values))


def quantile(values: Sequence[float], share: float) -> float | None:
    """The least value that so large a share of them does not exceed; None without values.

    One of the values, never between two: some may be infinite.
    """
    return float(np.quantile(values, share, method="inverted_cdf")) if len(values) else None


def finite(value: float | None) -> float | None:
    """A value as JSON has it: None where it is infinite or there is none."""
    return value if value is not None and math.isfinite(value) else None
