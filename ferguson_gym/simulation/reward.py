"""The reward: progress towards the goal, less penalties for detours and for failure."""

from __future__ import annotations

from typing import NamedTuple

from ferguson_gym.runtime.jit import compiled


class Penalties(NamedTuple):
    """Weights of the penalties; all progress from start to goal together is rewarded with 1."""

    detour: float
    """Weight of length beyond progress, as a fraction of the straight distance."""
    failure: float
    """Subtracted when a flight ends anywhere but on the goal."""


@compiled
def segment_reward(
    before: float, after: float, length: float, distance: float, penalties: Penalties
) -> float:
    """Reward of a segment that was flown, without the penalty for failure.

    `(progress - detour (length - progress)) / distance`. The rewards of a flight
    of L metres that reaches the goal sum to 1 - detour (L / D - 1), with D the straight distance.
    Progress telescopes and no segment is shorter than its progress, so circling never pays.
    `before` and `after` are straight distances to the goal [m], `distance` is that of the start.
    """
    progress = before - after
    return (progress - penalties.detour * (length - progress)) / distance
