"""Measures of flights and plans: success, SPL, gaps, their quantiles and progress in time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from ferguson_gym.runtime.arrays import Array

if TYPE_CHECKING:
    from agents.flights.flight import Flight

CONFIDENCE = 0.95
"""Confidence level of all intervals."""


class Interval(NamedTuple):
    """The ends of an interval."""

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
        raise ValueError(f"need at least one trial, got {successes} successes of {number}")
    # scipy.stats.binomtest has the same interval, but for whole numbers alone
    share, z = successes / number, float(ndtri(0.5 + CONFIDENCE / 2.0))
    middle = (share + z * z / (2.0 * number)) / (1.0 + z * z / number)
    half = z / (1.0 + z * z / number)
    half *= math.sqrt(share * (1.0 - share) / number + z * z / (4.0 * number**2))
    # rounding would move the ends beyond 0 and 1 by the last digit
    return Interval(0.0 if share == 0.0 else middle - half, 1.0 if share == 1.0 else middle + half)


def path_share(success: ArrayLike, length: ArrayLike, exact: ArrayLike | None) -> Array:
    """A flight's term in SPL: exact / max(length, exact) if it succeeded, else 0.

    Lengths [m] are (n,) or single values; an exact length of None or NaN is not known and counts 0.

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
    """The best length at times (n,) [s]: (n,) [m], infinite before the first.

    `progress` holds pairs of a time [s] and the length [m] reached then, in order of time.
    """
    at = np.array([when for when, _ in progress])
    best = np.minimum.accumulate([np.inf, *(length for _, length in progress)])
    return np.asarray(best[np.searchsorted(at, np.asarray(seconds), side="right")])


def share_within(values: Sequence[float | None], levels: ArrayLike) -> Array:
    """Share of values that are at most each level: (n,) in [0, 1]; None counts as infinite.

    With gaps this is a performance profile.

    Reference:
        Dolan & Moré (2002), Benchmarking optimization software with performance profiles,
        Mathematical Programming 91.
    """
    known = np.sort([value for value in values if value is not None])
    return np.searchsorted(known, np.asarray(levels), side="right") / max(1, len(values))


def quantile(values: Sequence[float], share: float) -> float | None:
    """The least value such that at least this share of values does not exceed it.

    It is always one of the values, since interpolation fails where some are infinite; None
    without values.
    """
    return float(np.quantile(values, share, method="inverted_cdf")) if len(values) else None


def finite(value: float | None) -> float | None:
    """A value for JSON: None where it is infinite, NaN or missing."""
    return value if value is not None and math.isfinite(value) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Success, SPL and gap of some flights."""

    flights: int
    success: float
    """Share of flights that succeeded."""
    success_low: float
    """Lower end of Wilson's 95 % interval of `success`."""
    success_high: float
    spl: float
    """Mean of success x exact / max(length, exact)."""
    gap: float | None
    """Median over successful flights; None without any."""


def score(flights: Sequence[Flight]) -> Score:
    """Score flights.

    Raises:
        ValueError: There are no flights.
    """
    gaps = [flight.gap for flight in flights if flight.gap is not None]
    successes = sum(flight.success for flight in flights)
    low, high = success_interval(successes, len(flights))
    return Score(
        flights=len(flights),
        success=successes / len(flights),
        success_low=low,
        success_high=high,
        spl=float(np.mean([flight.path_share for flight in flights])),
        gap=float(np.median(gaps)) if gaps else None,
    )
