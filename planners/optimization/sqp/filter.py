"""A filter: pairs of objective and violation that a step must improve on, compiled.

Reference:
    Fletcher & Leyffer (2002), Nonlinear programming without a penalty function, Math. Prog. 91.
"""

from __future__ import annotations

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled

REMEMBERED = 20
"""Number of points that a filter remembers."""


@compiled
def remember(pairs: Array, count: int, objective: float, violation: float) -> int:
    """Remember a point in the place of the oldest of `pairs` (20, 2); return the new count."""
    pairs[count % REMEMBERED, 0] = objective
    pairs[count % REMEMBERED, 1] = violation
    return count + 1


@compiled
def accepts(pairs: Array, count: int, most: float, objective: float, violation: float) -> bool:
    """Whether a point improves the objective or the violation relative to each earlier one.

    A violation above `most` [m] is never accepted.
    """
    if not violation <= most:
        return False
    for k in range(min(count, REMEMBERED)):
        before, violation_before = pairs[k, 0], pairs[k, 1]
        if not (violation <= 0.99 * violation_before or objective <= before - 1e-3 * violation):
            return False
    return True
