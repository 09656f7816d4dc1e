"""Limits of segments and flights, and the one tolerance that every test allows."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

from ferguson_gym.runtime.arrays import finite


class LimitValues(NamedTuple):
    """The fields of `Limits`, for compiled functions."""

    shortest: float
    longest: float
    slowest: float
    gate: float
    tolerance: float
    segments: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds on a single segment, and on the number of segments of a flight.

    Raises:
        ValueError: limits that contradict each other.

    Reference:
        The paper, section III-C3, for the lengths; gate, least speed, tolerance and the
        number of segments are ours.
    """

    shortest: float = 3.0
    """Minimum arc length [m]. Excludes segments that hardly move, as in concave pockets."""
    longest: float = 15.0
    """Maximum arc length [m]; a third of the planning horizon."""
    slowest: float = 0.1
    """Minimum |X'(t)| [m per unit t]. Excludes corners, where the derivative vanishes."""
    gate: float = 1.0
    """Segments that end within this distance [m] of the goal are moved to end on it."""
    tolerance: float = 1e-5
    """Violation that every test allows [m]; covers the rounding of actions to float32."""
    segments: int = 40
    """Maximum number of segments of a flight."""

    def __post_init__(self) -> None:
        for field in fields(self):
            finite(f"limit {field.name}", getattr(self, field.name), ())
        if int(self.segments) != self.segments:
            raise ValueError(f"limit segments must be a whole number, got {self.segments}")
        if not 0 < self.shortest < self.longest:
            raise ValueError(
                f"need 0 < shortest < longest, got {self.shortest} m and {self.longest} m"
            )
        if not 0 <= self.tolerance < self.slowest:
            raise ValueError(
                f"need 0 <= tolerance < slowest, got {self.tolerance} m and {self.slowest} m"
            )
        if not 0 <= self.gate < self.shortest:
            raise ValueError(f"need 0 <= gate < shortest, got {self.gate} m and {self.shortest} m")
        if self.segments < 1:
            raise ValueError(f"a flight needs at least 1 segment, got {self.segments}")

    def numbers(self) -> LimitValues:
        """The limits as a named tuple, for compiled functions."""
        return LimitValues(
            float(self.shortest),
            float(self.longest),
            float(self.slowest),
            float(self.gate),
            float(self.tolerance),
            int(self.segments),
        )


PAPER_LIMITS = Limits()
"""The paper's segment lengths with this project's gate, tolerance and least speed."""
