"""Whether the agent or the planner decided each step of a shielded flight, and why."""

from __future__ import annotations

from enum import Enum


class ShieldDecision(Enum):
    """How a step was decided: by the agent, or by the planner for a reason."""

    AGENT = ("agent", "left to the agent")
    INFEASIBLE = ("infeasible", "the agent's segment was not feasible")
    NOT_CONTINUABLE = "not_continuable", "no feasible segment was known from the end of its segment"
    RUNNING_OUT = ("running_out", "its segment would have left too few segments to reach the goal")
    LOITERING = ("loitering", "it repeatedly came no nearer to the goal")
    GAVE_UP = ("gave_up", "it gave up")
    UNPROVEN = "unproven", "its segment failed a check but was flown, since the planner found none"
    STUCK = ("stuck", "neither found a feasible segment, and the flight ended")

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        """Stable name, used in files."""
        self.sentence = sentence
        """Description shown to users."""
