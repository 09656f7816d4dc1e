"""Speeds and accelerations of timed segments by dense sampling, refined where extremes lie."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array

GRID = np.linspace(0.0, 1.0, 65)
NAMES = ("greatest_speed", "across", "along", "acceleration")
NEAR = 0.4 ** np.arange(3, 16)
"""Distances from the slowest point: peaks of curvature are as narrow as the slow part."""


def values(control: Array, duration: Array, wind: Array, t: Array) -> Array:
    """Rates (4, segments, n) as in `NAMES`, at parameters (segments, n)."""
    start, end, leave, arrive = (control[:, row, None, :] for row in range(4))
    t, seconds = t[..., None], duration[:, None, None]
    # from the Hermite basis, independently of the library
    slope = 6.0 * (t * t - t) * (start - end) + (3.0 * t * t - 4.0 * t + 1.0) * leave
    v = (slope + (3.0 * t * t - 2.0 * t) * arrive) / seconds - wind
    a = (12.0 * t - 6.0) * (start - end) + (6.0 * t - 4.0) * leave + (6.0 * t - 2.0) * arrive
    a = a / seconds**2
    speed = np.hypot(v[..., 0], v[..., 1])
    cross, dot = v[..., 0] * a[..., 1] - v[..., 1] * a[..., 0], (v * a).sum(axis=-1)
    total = np.hypot(a[..., 0], a[..., 1])
    return np.stack([speed, np.abs(cross) / speed, np.abs(dot) / speed, total])


def _peaks(t: Array, value: Array, number: int) -> Array:
    """The best local maxima: indices (segments, number) of parameters (segments, n)."""
    value = np.nan_to_num(value)
    beyond = np.pad(value, ((0, 0), (1, 1)), constant_values=-np.inf)
    is_peak = (value >= beyond[:, :-2]) & (value >= beyond[:, 2:])
    order = np.argsort(np.where(is_peak, value, -np.inf), axis=1)
    return np.asarray(order[:, : -number - 1 : -1])


def _around(t: Array, best: Array) -> Array:
    """Parameters (segments, 9) between the neighbours of the best one of sorted parameters."""
    rows = np.arange(len(t))
    low, high = t[rows, np.maximum(best - 1, 0)], t[rows, np.minimum(best + 1, t.shape[1] - 1)]
    return np.asarray(low[:, None] + (high - low)[:, None] * GRID[None, ::8])


def _refined(
    given: tuple[Array, Array, Array], first: Array, value: Array, which: int, sign: float
) -> tuple[Array, Array]:
    """Parameters and values (segments, 3) of three peaks of one rate times sign."""
    places, found = [], []
    for best in _peaks(first, sign * value, 3).T:
        t, index = first, best
        for _ in range(7 if sign > 0.0 else 16):  # a speed can fall to zero as |t| does
            t = _around(t, index)
            peak = sign * np.nan_to_num(values(*given, t)[which])
            index = peak.argmax(axis=1)
        places.append(t[np.arange(len(t)), index])
        found.append(peak.max(axis=1))
    return np.stack(places, axis=1), sign * np.stack(found, axis=1)


def sampled_rates(control: Array, duration: Array, wind: Array) -> dict[str, Array]:
    """Extremes of segments (n, 4, 2) by the names of `Rates`."""
    given = (control, duration, wind)
    coarse = np.tile(GRID, (len(control), 1))
    slowest, speed = _refined(given, coarse, values(*given, coarse)[0], 0, -1.0)
    result = {"least_speed": speed.min(axis=1)}
    # other distances around the second one, since all parameters must be different
    near = slowest[:, :2, None] + np.array([[1.0], [0.7]]) * np.concatenate([-NEAR, NEAR])
    near = near.reshape(len(control), -1)
    # what lies outside is replaced by further points inside, all different
    inside = np.linspace(0.003, 0.997, near.shape[1])
    near = np.where((near > 0.0) & (near < 1.0), near, inside)
    first = np.sort(np.concatenate([coarse, near], axis=1), axis=1)
    found = values(*given, first)
    for which, name in enumerate(NAMES):
        result[name] = _refined(given, first, found[which], which, 1.0)[1].max(axis=1)
    return result
