"""A filter: points of a search, as pairs of objective and violation, that a step must improve on.

Reference:
    Fletcher & Leyffer (2002), Nonlinear programming without a penalty function,
    Mathematical Programming 91.
"""

from __future__ import annotations

_REMEMBERED = 20
"""Points that a filter holds."""


class Filter:
    """Judges steps without weighing objective against violation."""

    def __init__(self, most: float) -> None:
        """For violations [m] up to `most`."""
        self._most = most
        self._pairs: list[tuple[float, float]] = []

    def add(self, objective: float, violation: float) -> None:
        """Take in a point."""
        self._pairs.append((objective, violation))
        del self._pairs[:-_REMEMBERED]

    def accepts(self, objective: float, violation: float) -> bool:
        """Whether a point lessens the objective or the violation against every point held."""
        if not violation <= self._most:
            return False
        # not a generator, which takes longer
        for before, lacked in self._pairs:
            if not (violation <= 0.99 * lacked or objective <= before - 1e-3 * violation):
                return False
        return True
