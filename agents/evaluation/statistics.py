"""Statistics of an evaluation: of each policy and of pairs of policies, with intervals.

Failed flights are never dropped. In SPL a failure counts 0; its gap is infinite; in a comparison it
loses against any success. Only fields whose shortest path is not known are left out of gaps, for
all policies. Intervals are for 95 %.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from agents.evaluation.bootstrap import (
    RESAMPLES,
    percentiles,
    resampled_means,
    resampled_quartile_means,
)
from agents.evaluation.reading import read
from agents.evaluation.summary import recorded_knowledge
from agents.flights.flight_table import TIMES, FlightTable
from agents.flights.metrics import (
    CONFIDENCE,
    Interval,
    finite,
    path_share,
    quantile,
    share_within,
    success_interval,
)
from agents.policies.knowledge import LEGEND, Knows, labels
from agents.runtime.chunk_store import read_json
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Outcome

TIE = 1e-5
"""Lengths that differ by at most this are ties [m]: the tolerance of every feasibility test."""
LEAST_GAP = 1e-5
"""Gap at which performance profiles begin."""
FEW = 20
"""Number of fields below which a caution on intervals is shown."""
_LEVELS = 241
"""Number of levels of a performance profile, at equal ratios."""

HOW = {
    "knows": f"What a policy knows of the obstacles. {LEGEND}.",
    "success": "Share of flights that were feasible and ended on the goal. Wilson's interval, over "
    "fields: several policy seeds on a field count as one trial, because flights with different "
    "policy seeds on the same field may be identical.",
    "spl": "Mean over all flights of success x exact / max(length, exact); a failure counts 0, and "
    "so does a field without a known shortest path. Bootstrap interval over fields, and over "
    "policy seeds where there are several.",
    "gap": "Length / exact - 1; a failed flight has an infinite gap, so that the median, the "
    "interquartile mean and the percentiles are infinite for policies that fail too often. Fields "
    "without a known shortest path are left out, for all policies. Bootstrap interval as for SPL.",
    "pairs": "On the same fields and seeds. Success: exact McNemar test on the fields where only "
    "one of the two policies succeeds (with several seeds: where one succeeds more often), also "
    "adjusted by Holm for the number of pairs. SPL: paired bootstrap.",
    "improvement": "Share of flights in which the first policy flies the shorter path (probability "
    "of improvement); a tie within 1e-5 m, or two failures, count half; a failure loses against "
    "any success.",
    "profiles": "Share of flights with a gap of at most x; a failed flight counts as an infinite "
    "gap.",
    "times": "Measured on up to 20 flights of each policy, one policy at a time, while nothing "
    "else of the evaluation ran: median and 99th percentile over decisions, median over flights. "
    "For a policy that was not timed separately, times from the evaluation itself are shown.",
}
"""What each statistic is and how it treats failures: sentences for summary.json and the report."""


def summarise(directory: str | Path, seed: int = 0) -> dict[str, Any]:
    """Statistics of a results directory, as `summary` has them.

    Raises:
        ValueError: As `agents.evaluation.reading.read`.
    """
    directory = Path(directory)
    recorded = recorded_knowledge(read_json(directory / "summary.json"))
    return summary(read(directory), seed, recorded)


def summary(
    flights: FlightTable, seed: int = 0, knows: Mapping[str, object] = MappingProxyType({})
) -> dict[str, Any]:
    """All statistics as JSON values; the same arguments give the same.

    Values that are infinite or missing are None; a gap is infinite where `gap_flights` is not 0.

    Args:
        flights: of all policies.
        seed: of the bootstrap.
        knows: labels of what policies know, by name; others follow from the names, or are None.

    Returns:
        `policies` and `pairs`, a list of objects each; `profiles` with `gap`, the levels, and
        `shares` by policy; `how`, what the statistics mean; `confidence`, `resamples`, `seed`.
    """
    gaps = _gaps(flights)
    levels = profile_levels(flights["gap"][flights.success])
    return {
        "flights": len(flights),
        "fields": len(flights.fields),
        "seeds": len(flights.seeds),
        "confidence": CONFIDENCE,
        "resamples": RESAMPLES,
        "seed": seed,
        "how": HOW,
        "policies": policy_statistics(flights, seed, labels(flights.policies, knows)),
        "pairs": pair_statistics(flights, seed),
        "profiles": {
            "gap": [float(f"{level:.4g}") for level in levels],
            "shares": {
                name: np.round(share_within(list(_known(gaps[k])), levels), 6).tolist()
                for k, name in enumerate(flights.policies)
            },
        },
    }


def policy_statistics(flights: FlightTable, seed: int, knows: Knows) -> list[dict[str, Any]]:
    """Success, SPL, gaps and times of each policy; `HOW` says how failures are treated."""
    if len(flights) == 0:
        return []
    shares = flights.grid(path_share(flights.success, flights["length"], flights["exact_length"]))
    spl = resampled_means(shares, seed)
    gaps = _gaps(flights)
    found = []
    for k, name in enumerate(flights.policies):
        mine = flights.policy == k
        successes, number = int(flights.success[mine].sum()), int(mine.sum())
        median, slowest, whole = (_known(flights[name][mine]).tolist() for name in TIMES)
        known = _known(gaps[k])
        fields = len(np.unique(flights.field[mine]))
        success = success_interval(fields * successes / number, fields)
        found.append(
            {
                "policy": name,
                "knows": knows[name],
                "flights": number,
                "fields": fields,
                "successes": successes,
                "outcomes": _counts(flights["outcome"][mine]),
                "success": successes / number,
                "success_low": success.low,
                "success_high": success.high,
                "spl": float(np.nanmean(shares[k])),
                **_bounds("spl", percentiles(spl[:, k], fields)),
                "gap_flights": len(known),
                "gap_median": finite(quantile(known.tolist(), 0.5)),
                "gap_iqm": finite(interquartile_mean(known)),
                **_bounds("gap_iqm", percentiles(resampled_quartile_means(gaps[k], seed), fields)),
                "gap_90": finite(quantile(known.tolist(), 0.9)),
                "gap_99": finite(quantile(known.tolist(), 0.99)),
                "decision_seconds_median": quantile(median, 0.5),
                "slowest_decision_seconds_99": quantile(slowest, 0.99),
                "flight_seconds_median": quantile(whole, 0.5),
                "flight_seconds_99": quantile(whole, 0.99),
            }
        )
    return found


def pair_statistics(flights: FlightTable, seed: int) -> list[dict[str, Any]]:
    """Comparison of each pair of policies on the same fields and seeds, as `HOW` says."""
    pairs = list(itertools.combinations(range(len(flights.policies)), 2))
    if not pairs:
        return []
    shares = flights.grid(path_share(flights.success, flights["length"], flights["exact_length"]))
    lengths = flights.grid(np.where(flights.success, flights["length"], math.inf))
    first, second = (np.array(side) for side in zip(*pairs, strict=True))
    better = improvement(lengths[first], lengths[second])
    drawn_spl = resampled_means(shares[first] - shares[second], seed)
    drawn_better = resampled_means(better, seed)
    won = [success_wins(lengths[a], lengths[b]) for a, b in pairs]
    chances = [mcnemar(*wins) for wins in won]
    found = []
    for k, ((a, b), adjusted) in enumerate(zip(pairs, holm(chances), strict=True)):
        together = ~np.isnan(better[k])
        fields = int(together.any(axis=1).sum())
        if fields == 0:
            continue
        found.append(
            {
                "first": flights.policies[a],
                "second": flights.policies[b],
                "flights": int(together.sum()),
                "first_wins": won[k][0],
                "second_wins": won[k][1],
                "mcnemar_p": chances[k],
                "mcnemar_p_holm": adjusted,
                "spl_difference": float(np.nanmean(shares[a] - shares[b])),
                **_bounds("spl_difference", percentiles(drawn_spl[:, k], fields)),
                "improvement": float(np.nanmean(better[k])),
                **_bounds("improvement", percentiles(drawn_better[:, k], fields)),
            }
        )
    return found


def interquartile_mean(values: ArrayLike) -> float | None:
    """Mean without the least and the greatest quarter; None without values.

    With failures as infinity it is finite as long as no more than a quarter failed.

    Reference:
        Agarwal et al. (2021), Deep reinforcement learning at the edge of the statistical
        precipice, NeurIPS 34.
    """
    values = np.asarray(values, float)
    if not len(values):
        return None
    cut = len(values) // 4
    # as scipy.stats.trim_mean, to the last digit
    return float(np.partition(values, (cut, len(values) - cut - 1))[cut : len(values) - cut].mean())


def success_wins(first: Array, second: Array) -> tuple[int, int]:
    """On how many fields the first succeeds more often than the second, and the reverse.

    Lengths (fields, seeds) [m] are infinite for failures and NaN where not flown; seeds that only
    one of the two flew do not count.
    """
    together = ~(np.isnan(first) | np.isnan(second))
    lead = ((np.isfinite(first) & together).sum(1)) - ((np.isfinite(second) & together).sum(1))
    return int((lead > 0).sum()), int((lead < 0).sum())


def mcnemar(first: int, second: int) -> float:
    """p-value of McNemar's exact test: of wins at least so unequal if both were equally good.

    The arguments count the fields on which only the first succeeded, and only the second. Fields
    where both succeed or both fail carry no information on the difference.

    Reference:
        McNemar (1947), Note on the sampling error of the difference between correlated
        proportions or percentages, Psychometrika 12.

    Example:
        >>> round(mcnemar(1, 9), 4)
        0.0215
    """
    if first + second == 0:
        return 1.0
    from scipy.stats import binomtest  # takes half a second, and most evaluations do not need it

    return float(binomtest(first, first + second).pvalue)


def holm(chances: list[float]) -> list[float]:
    """p-values of several tests, adjusted by Holm so that they hold jointly.

    Reference:
        Holm (1979), A simple sequentially rejective multiple test procedure, Scandinavian
        Journal of Statistics 6.
    """
    order = np.argsort(chances, kind="stable")
    factors = np.arange(len(chances), 0, -1)
    adjusted = np.empty(len(chances))
    raised = np.maximum.accumulate(np.array(chances)[order] * factors)
    adjusted[order] = np.minimum(raised, 1.0)
    return list(adjusted.tolist())


def improvement(first: Array, second: Array) -> Array:
    """1 where the first is shorter, 0 where it is longer, a half for ties.

    Lengths [m] of any one shape are infinite for failures, so that a failure loses against any
    success and two failures are a tie. NaN where either was not flown.
    """
    with np.errstate(invalid="ignore"):  # infinity less infinity
        alike = (np.abs(first - second) <= TIE) | (first == second)
    better = np.where(alike, 0.5, (first < second).astype(float))
    better[np.isnan(first) | np.isnan(second)] = math.nan
    return better


def caution(found: Mapping[str, Any]) -> str | None:
    """A warning where a summary compares policies on a few fields; None otherwise."""
    if found["fields"] >= FEW or len(found["policies"]) < 2:
        return None
    return (
        f"With so few fields ({found['fields']}) bootstrap intervals are too narrow, and "
        "differences may be due to chance."
    )


def profile_levels(gaps: Array) -> Array:
    """Levels of a performance profile, at equal ratios from `LEAST_GAP` to beyond all gaps."""
    greatest = max([10.0 * LEAST_GAP, *gaps[np.isfinite(gaps)]])
    return np.geomspace(LEAST_GAP, 1.1 * greatest, _LEVELS)


def _gaps(flights: FlightTable) -> Array:
    """(policies, fields, seeds); infinite for failures, NaN without flight or shortest path."""
    gaps = np.where(flights.success, flights["gap"], math.inf)
    gaps[np.isnan(flights["exact_length"])] = math.nan
    return flights.grid(gaps)


def _known(values: Array) -> Array:
    return values[~np.isnan(values)]


def _bounds(name: str, interval: Interval | None) -> Mapping[str, float | None]:
    low, high = interval or (None, None)
    return {f"{name}_low": finite(low), f"{name}_high": finite(high)}


def _counts(codes: NDArray[np.int8]) -> dict[str, int]:
    return {Outcome.from_code(code).label: n for code, n in Counter(codes.tolist()).most_common()}
