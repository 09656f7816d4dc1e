"""In whose hands each step of a shielded flight was, and why."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum


class ShieldDecision(Enum):
    """Who decided a step: the agent, or the planner and why. Labels are stable."""

    AGENT = ("agent", "left to the agent")
    INFEASIBLE = ("infeasible", "the agent's segment was not feasible")
    NOT_CONTINUABLE = ("not_continuable", "no way on was known from the end of its segment")
    RUNNING_OUT = ("running_out", "its segment would have left too few to reach the goal")
    LOITERING = ("loitering", "it led no nearer to the goal, again")
    GAVE_UP = ("gave_up", "it found no segment itself")
    UNPROVEN = ("unproven", "it was doubtful, yet flown: the planner found nothing either")
    STUCK = ("stuck", "neither had anything feasible, and the flight ended")

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        """Stable name, as in files."""
        self.sentence = sentence
        """What people are shown."""


def share_handed_over(hands: Sequence[ShieldDecision]) -> float:
    """Share of steps, at least one, that were not left to the agent."""
    return sum(hand is not ShieldDecision.AGENT for hand in hands) / len(hands)
