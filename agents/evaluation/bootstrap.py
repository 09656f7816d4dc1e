"""The bootstrap: intervals of statistics over fields and policy seeds."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from agents.flights.metrics import CONFIDENCE, Interval
from ferguson_gym.runtime.arrays import Array

RESAMPLES = 1000
"""Number of resamples; intervals are percentiles of them."""
_AT_ONCE = 1_000_000
"""Maximum number of values in memory, so that it does not grow with the number of flights."""


def draws(
    fields: int, seeds: int, seed: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """How often each field and each seed is drawn: (m, fields) and (m, seeds), in portions.

    Fields and seeds are drawn independently of each other, and a flight counts as often as
    its field times its seed. A policy whose flights do not depend on the seed thus gets the
    interval that one seed would give.

    Reference:
        Owen (2007), The pigeonhole bootstrap, Annals of Applied Statistics 1.
    """
    rng = np.random.default_rng(seed)
    portion = max(1, min(RESAMPLES, _AT_ONCE // (fields * seeds)))
    for begin in range(0, RESAMPLES, portion):
        number = min(portion, RESAMPLES - begin)
        yield _drawn(rng, number, fields), _drawn(rng, number, seeds)


def _drawn(rng: np.random.Generator, number: int, size: int) -> NDArray[np.int64]:
    chosen = rng.integers(size, size=(number, size))
    chosen += size * np.arange(number)[:, None]
    return np.bincount(chosen.ravel(), minlength=number * size).reshape(number, size)


def resampled_means(values: Array, seed: int) -> Array:
    """Means of k tables (k, fields, seeds) over resampled fields and seeds, (RESAMPLES, k).

    NaN is a missing value, which does not count. All tables are resampled alike, so that
    differences between them are paired.
    """
    count, fields, seeds = values.shape
    present = ~np.isnan(values)
    tables = [np.where(present, values, 0.0)]
    if not present.all():
        tables.append(present.astype(float))
    flat = np.concatenate(tables).transpose(1, 0, 2).reshape(fields, -1)
    means = []
    for by_field, by_seed in draws(fields, seeds, seed):
        sums = (by_field @ flat).reshape(len(by_field), -1, seeds)
        totals = np.einsum("bks,bs->bk", sums, by_seed)
        weights = totals[:, count:] if len(tables) > 1 else np.array(fields * seeds)
        with np.errstate(invalid="ignore"):  # a resample may miss all of a table's values
            means.append(totals[:, :count] / weights)
    return np.concatenate(means)


def resampled_quartile_means(values: Array, seed: int) -> Array:
    """Interquartile means of values (fields, seeds) over resampled fields and seeds, (RESAMPLES,).

    Values may be infinite; NaN is a missing value, which does not count.
    """
    field, which = np.nonzero(~np.isnan(values))
    flat = values[field, which]
    order = np.argsort(flat, kind="stable")
    field, which, flat = field[order], which[order], flat[order]
    finite = int(np.isfinite(flat).sum())
    means = []
    for by_field, by_seed in draws(values.shape[0], values.shape[1], seed):
        weights = by_field[:, field]
        if by_seed.shape[1] > 1:
            weights = weights * by_seed[:, which]
        # ranks up to which each value goes; a quarter of the ranks is cut at both ends, in place
        ranks = np.cumsum(weights, axis=1, out=weights)
        total = ranks[:, -1:].copy() if len(flat) else np.zeros((len(ranks), 1), np.int64)
        cut = total // 4
        np.clip(ranks, cut, total - cut, out=ranks)
        kept = np.diff(ranks, axis=1, prepend=cut)
        with np.errstate(invalid="ignore"):
            mean = (kept[:, :finite] @ flat[:finite]) / (total - 2 * cut)[:, 0]
        mean[kept[:, finite:].any(axis=1)] = math.inf
        means.append(mean)
    return np.concatenate(means)


def percentiles(drawn: Array, fields: int) -> Interval | None:
    """The central interval of resampled values; None for a single field."""
    drawn = drawn[~np.isnan(drawn)]
    if fields < 2 or not len(drawn):
        return None
    tail = (1.0 - CONFIDENCE) / 2.0
    # not between two values: some may be infinite
    low, high = np.quantile(drawn, [tail, 1.0 - tail], method="inverted_cdf")
    return Interval(float(low), float(high))
