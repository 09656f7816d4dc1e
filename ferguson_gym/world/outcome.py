"""How a flight ends: an integer code for arrays, a stable name for files, a sentence for people."""

from __future__ import annotations

from enum import Enum


class Outcome(Enum):
    """Outcome of a segment or flight. Codes and names never change, since data stores them."""

    FLYING = (0, "flying", "still on its way")
    GOAL_REACHED = (1, "goal_reached", "reached the goal")
    COLLISION = (2, "collision", "cut into an obstacle")
    TOO_LONG = (3, "too_long", "a segment was too long")
    TOO_SHORT = (4, "too_short", "a segment was too short")
    NOT_REGULAR = (5, "not_regular", "the parametric speed of a segment was too low (a cusp)")
    LEFT_BOUNDS = (6, "left_bounds", "left the bounds of the field")
    OUT_OF_SEGMENTS = (7, "out_of_segments", "used up its segments before the goal")
    GAVE_UP = (8, "gave_up", "the policy found no further segment")

    def __init__(self, code: int, label: str, sentence: str) -> None:
        self.code = code
        """Integer code, as in `info["outcome"]`."""
        self.label = label
        """Stable name, as in files."""
        self.sentence = sentence
        """Text shown to users."""

    @property
    def success(self) -> bool:
        """Whether the flight was feasible and ended on the goal."""
        return self is Outcome.GOAL_REACHED

    @classmethod
    def from_code(cls, code: int) -> Outcome:
        """The outcome with this integer code.

        Raises:
            ValueError: no outcome has the code.
        """
        for outcome in cls:
            if outcome.code == code:
                return outcome
        raise ValueError(f"no outcome has code {code}; codes run from 0 to {len(cls) - 1}")
