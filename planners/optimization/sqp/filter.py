"""A filter: pairs of objective and violation that a step must improve on.

Reference:
    Fletcher & Leyffer (2002), Nonlinear programming without a penalty function, Math. Prog. 91.
"""

from __future__ import annotations

_REMEMBERED = 20
"""Number of points that a filter remembers."""


class Filter:
    """Accepts steps without a penalty parameter."""

    def __init__(self, most: float) -> None:
        """Accept violations [m] up to `most` only."""
        self._most = most
        self._pairs: list[tuple[float, float]] = []

    def add(self, objective: float, violation: float) -> None:
        """Remember a point."""
        self._pairs.append((objective, violation))
        del self._pairs[:-_REMEMBERED]

    def accepts(self, objective: float, violation: float) -> bool:
        """Whether a point improves the objective or the violation relative to each earlier one."""
        if not violation <= self._most:
            return False
        # a loop, since a generator takes longer
        for before, violation_before in self._pairs:
            if not (violation <= 0.99 * violation_before or objective <= before - 1e-3 * violation):
                return False
        return True
