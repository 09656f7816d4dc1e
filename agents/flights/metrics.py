"""What is told of many plans: success with its uncertainty, progress in time, profiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import binomtest

from ferguson_gym.runtime.arrays import Array

CONFIDENCE = 0.95
"""Of intervals."""


class Interval(NamedTuple):
    """From where to where."""

    low: float
    high: float


def success_interval(successes: int, number: int) -> Interval:
    """Wilson's interval of the chance of success.

    Raises:
        ValueError: no attempts, or more successes than those.

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
    found = binomtest(successes, number).proportion_ci(CONFIDENCE, method="wilson")
    return Interval(float(found.low), float(found.high))


def path_share(success: bool, length: float, exact: float | None) -> float:
    """A flight's part in SPL: exact / max(length, exact) [m] if it arrived, else 0.

    Reference:
        Anderson et al. (2018), On evaluation of embodied navigation agents, arXiv:1807.06757.

    Example:
        >>> path_share(True, length=150.0, exact=144.0), path_share(False, 20.0, 144.0)
        (0.96, 0.0)
    """
    return exact / max(length, exact) if success and exact is not None else 0.0


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
