"""Whether a flight keeps its vehicle's limits: a code, a stable name, and a sentence for people."""

from __future__ import annotations

from enum import Enum


class VehicleOutcome(Enum):
    """Which limit of a vehicle a flight breaks first. Codes and names never change."""

    WITHIN_LIMITS = (0, "within_limits", "keeps all limits of the vehicle")
    TOO_SLOW = (1, "too_slow", "flies slower than the vehicle can")
    TOO_FAST = (2, "too_fast", "flies faster than the vehicle can")
    TOO_STEEP = (3, "too_steep", "needs more roll in a turn than the vehicle has")
    TOO_HARD_ALONG = (4, "too_hard_along", "accelerates too hard along its path")
    TOO_HARD = (5, "too_hard", "accelerates too hard")

    def __init__(self, code: int, label: str, sentence: str) -> None:
        self.code = code
        """Integer code, for arrays."""
        self.label = label
        """Stable name, for files."""
        self.sentence = sentence
        """Text shown to users."""

    @property
    def success(self) -> bool:
        """Whether all limits are kept."""
        return self is VehicleOutcome.WITHIN_LIMITS


FAILURES = tuple(outcome for outcome in VehicleOutcome if not outcome.success)
"""The failures, in the order in which the first one is reported."""
