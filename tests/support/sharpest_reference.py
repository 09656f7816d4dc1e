"""The greatest curvature found otherwise: dense samples, then a search in exact numbers."""

import numpy as np

from ferguson_gym.curves.splines import derivative
from ferguson_gym.runtime.arrays import Array

GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


def exact_curvature(control: Array, t: float) -> float:
    """Curvature at t without rounding but for the last operations; infinite at rest.

    Every number is a whole one divided by a power of two, which the whole numbers below leave out:
    fractions would be reduced after each operation, in ten times the time.
    """
    at, whole = float(t).as_integer_ratio()
    rest = whole - at
    ratios = [[float(value).as_integer_ratio() for value in axis] for axis in np.transpose(control)]
    unit = max(power for axis in ratios for _, power in axis)
    first, second = [], []
    for axis in ratios:
        p, q, r, s = (number * (unit // power) for number, power in axis)
        middle = 3 * (q - p) - r - s
        first.append(rest**2 * r + 2 * at * rest * middle + at**2 * s)  # / (unit whole^2)
        second.append(2 * rest * (middle - r) + 2 * at * (s - middle))  # / (unit whole)
    speed2 = sum(one * one for one in first)
    if speed2 == 0:
        return np.inf
    cross2 = sum(
        (first[i] * second[j] - first[j] * second[i]) ** 2
        for i in range(len(first))
        for j in range(i)
    )
    return float(np.sqrt(cross2 * unit**2 * whole**6 / speed2**3))


def slowest(control: Array) -> tuple[Array, float]:
    """Parameters near which the speed is least, and the least speed as part of the greatest."""
    polynomials = np.polynomial.polynomial.polyfit(
        np.array([0.0, 0.5, 1.0]), derivative(control, [0.0, 0.5, 1.0]), 2
    )
    speed2 = sum(
        (np.polynomial.Polynomial(one) ** 2 for one in polynomials.T), np.polynomial.Polynomial([0])
    )
    # a leading coefficient that is rounding alone would move all roots
    slope = speed2.deriv().trim(1e-13 * np.abs(speed2.coef).max())
    t = np.clip(np.array([0.0, 1.0, *slope.roots().real]), 0.0, 1.0)
    speeds = np.linalg.norm(derivative(control, np.array([*t, *np.linspace(0, 1, 101)])), axis=-1)
    return t, float(speeds.min() / speeds.max())


def reference(control: Array) -> float:
    """Greatest curvature [1/m] of one segment (4, D)."""
    near, _ = slowest(control)
    around = np.geomspace(1e-12, 0.1, 400)
    t = np.concatenate([np.linspace(0.0, 1.0, 2001), *(at + around for at in near)])
    t = np.unique(np.clip(np.concatenate([t, *(at - around for at in near), near]), 0.0, 1.0))
    first, second = derivative(control, t), derivative(control, t, 2)
    speed2 = np.maximum((first * first).sum(-1), 1e-300)
    normal = second - ((first * second).sum(-1) / speed2)[:, None] * first
    bend = np.sqrt((normal * normal).sum(-1)) / speed2
    inner = np.concatenate([[-np.inf], bend, [-np.inf]])
    peaks = np.flatnonzero((bend >= inner[:-2]) & (bend >= inner[2:]))
    best = 0.0
    for k in peaks[np.argsort(-bend[peaks])][:3]:
        low, high = t[max(k - 1, 0)], t[min(k + 1, len(t) - 1)]
        best = max(best, *(exact_curvature(control, at) for at in (t[k], low, high)))
        for _ in range(60):
            step = GOLDEN * (high - low)
            left, right = (
                exact_curvature(control, high - step),
                exact_curvature(control, low + step),
            )
            best = max(best, left, right)
            if left > right:
                high = low + step
            else:
                low = high - step
            if high - low < 1e-13:
                break
    return best
