"""Limits of segments and flights, and the one tolerance that every test allows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

from ferguson_gym.runtime.arrays import finite, truncate_repr
from ferguson_gym.runtime.suggestions import did_you_mean

PAPER_LONGEST = 15.0
"""The paper's longest segment [m], the default."""
RATIOS = {
    "shortest": 3.0 / PAPER_LONGEST,
    "slowest": 0.1 / PAPER_LONGEST,
    "gate": 1.0 / PAPER_LONGEST,
    "tolerance": 1e-5 / PAPER_LONGEST,
}
"""Ratios of limits to the longest segment: those of the paper, and ours where it has none."""
DETOUR = 4.25
"""The default number of segments flies this many times the straight distance to the goal."""
STEEPEST_RATIO = 4.3904
"""No |X'| of a cubic exceeds this multiple of its length, rounded up: 4.39031 is the greatest value
at an end of a quadratic polynomial whose absolute value has integral one on [0, 1]."""
FEWEST = 40
"""Least default number of segments: that of the paper's fields."""

_BY_RATIO: Any = None
_BY_DISTANCE: Any = None


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

    They belong to a field (`Field.limits`) and set its scale: limits that are not given keep the
    paper's ratio to `longest`.

    Raises:
        ValueError: limits that contradict each other.

    Reference:
        The paper, section III-C3, for the lengths; gate, least speed, tolerance and the
        number of segments are ours.

    Example:
        >>> Limits(longest=150.0, gate=2.0).shortest
        30.0
    """

    shortest: float = _BY_RATIO
    """Minimum arc length [m], by default 3 / 15 of `longest`. Excludes segments that hardly move,
    as in concave pockets."""
    longest: float = PAPER_LONGEST
    """Maximum arc length [m]; a third of the planning horizon."""
    slowest: float = _BY_RATIO
    """Minimum |X'(t)| [m per unit t], by default 0.1 / 15 of `longest`. Excludes corners, where
    the derivative vanishes."""
    gate: float = _BY_RATIO
    """Segments that end within this distance [m] of the goal are moved to end on it; by default
    1 / 15 of `longest`."""
    tolerance: float = _BY_RATIO
    """Violation that every test allows [m], by default 1e-5 / 15 of `longest`; covers the rounding
    of actions to float32."""
    segments: int = _BY_DISTANCE
    """Maximum number of segments of a flight. None until a field sets its default: as many as fly
    4.25 times the straight distance from start to goal, and at least 40."""

    def __post_init__(self) -> None:
        finite("limit longest", self.longest, ())
        for name, ratio in RATIOS.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, ratio * float(self.longest))
            finite(f"limit {name}", getattr(self, name), ())
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
        if self.segments is not None:
            finite("limit segments", self.segments, ())
            if int(self.segments) != self.segments:
                raise ValueError(f"limit segments must be a whole number, got {self.segments}")
            if self.segments < 1:
                raise ValueError(f"a flight needs at least 1 segment, got {self.segments:g}")
            object.__setattr__(self, "segments", int(self.segments))

    @classmethod
    def of(cls, given: object) -> Limits:
        """Limits themselves, or from a mapping of names to values, as in a field's JSON file.

        Raises:
            ValueError: a name that is not a limit's, or as `Limits`.
        """
        if isinstance(given, Limits):
            return given
        if not isinstance(given, Mapping):
            raise ValueError(
                f"limits are names with values, for example {{'longest': 150}}, "
                f"got {truncate_repr(given)}"
            )
        check_names(given)
        return cls(**given)

    @property
    def unit(self) -> float:
        """A fifteenth of `longest` [m]: 1 m in the paper's fields.

        Lengths in the code that no field sets, for example strides, are multiples of it.
        """
        return float(self.longest) / PAPER_LONGEST

    @property
    def steepest(self) -> float:
        """Maximum |X'(t)| [m per unit t] that a feasible segment can have."""
        return STEEPEST_RATIO * (self.longest + self.tolerance)

    def for_distance(self, distance: float) -> Limits:
        """These limits with a number of segments, by default for this distance to the goal [m]."""
        if self.segments is not _BY_DISTANCE:
            return self
        return replace(self, segments=max(FEWEST, round(DETOUR * distance / float(self.longest))))

    def changed(self, distance: float, changes: Mapping[str, Any]) -> Limits:
        """These limits with other values of some of them.

        Another `longest` scales the lengths that are not among the changes, and a number of
        segments that is the default for the distance to the goal [m] becomes the new default.

        Raises:
            ValueError: as `of`.
        """
        given = Limits.of(changes)
        factor = given.longest / self.longest if "longest" in changes else 1.0
        values = {name: factor * getattr(self, name) for name in RATIOS}
        if self.segments != replace(self, segments=_BY_DISTANCE).for_distance(distance).segments:
            values["segments"] = self.segments
        limits = Limits(**{"longest": self.longest, **values, **changes})
        return limits.for_distance(distance)

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


def check_names(given: Iterable[object]) -> None:
    """Refuse names that are not those of limits.

    Raises:
        ValueError: an unknown name; the message has the known ones.
    """
    known = [field.name for field in fields(Limits)]
    for name in given:
        if name not in known:
            near = did_you_mean(str(name), known)
            raise ValueError(f"unknown limit {name!r}{near}; limits are {', '.join(known)}")


PAPER_LIMITS = Limits(segments=FEWEST)
"""The paper's segment lengths with this project's gate, tolerance and least speed."""
