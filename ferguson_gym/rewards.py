"""The reward: progress towards the goal less path length, and a price for failure."""

from __future__ import annotations

import numpy as np

from ferguson_gym.fields import Field
from ferguson_gym.flight import State, Step
from ferguson_gym.outcome import Outcome

LENGTH_WEIGHT = 0.5
"""Weight of path length against progress."""
FAILURE = -1.0
"""Added when a flight ends anywhere but on the goal."""


def reward(field: Field, before: State, step: Step) -> float:
    """(progress - length / 2) / (straight distance from start to goal), less 1 on failure.

    Summed over a flight that reaches the goal over L metres this is 1 - L / (2 D), with D
    the straight distance. A failure sums to at most -1/2, since no path is shorter than
    its progress: every flight shorter than 3 D returns more than every failure.
    """
    total = 0.0
    if step.flown:
        left_before = float(np.linalg.norm(field.goal - before.position))
        left_after = float(np.linalg.norm(field.goal - step.state.position))
        flown = float(step.inspection.length)
        total = (left_before - left_after - LENGTH_WEIGHT * flown) / field.distance
    if step.outcome not in (Outcome.FLYING, Outcome.GOAL_REACHED):
        total += FAILURE
    return total
