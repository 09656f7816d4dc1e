"""The reward of a segment; `step_kernel` subtracts the penalty for failure from it."""

from __future__ import annotations

from typing import NamedTuple

from ferguson_gym.runtime.jit import compiled


class Penalties(NamedTuple):
    """Weights of the penalties; all progress from start to goal together is rewarded with 1."""

    detour: float
    """Weight of length beyond progress, as a fraction of the straight distance."""
    failure: float
    """Subtracted if a flight ends without reaching the goal."""


@compiled
def segment_reward(
    before: float, after: float, length: float, distance: float, penalties: Penalties
) -> float:
    """Reward of a segment that was flown, without the penalty for failure.

    `(progress - detour (length - progress)) / distance`. The rewards of a flight of L metres that
    reaches the goal sum to 1 - detour (L / D - 1), with D the straight distance. The progress of
    all segments sums to at most D, and no segment is shorter than its progress, so loops are never
    rewarded. `before` and `after` are straight distances to the goal [m], `distance` is that of the
    start.
    """
    progress = before - after
    return (progress - penalties.detour * (length - progress)) / distance
