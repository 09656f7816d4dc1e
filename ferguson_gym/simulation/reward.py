"""The reward: progress towards the goal, a price for detours and a price for failure."""

from __future__ import annotations

from typing import NamedTuple

from ferguson_gym.runtime.jit import compiled


class Prices(NamedTuple):
    """What a flight is charged; progress pays 1 over the straight distance to the goal."""

    detour: float
    """For length beyond progress, times the straight distance."""
    failure: float
    """When a flight ends anywhere but on the goal."""


@compiled
def gain(before: float, after: float, length: float, distance: float, prices: Prices) -> float:
    """Reward of a segment that was flown.

    `(progress - detour (length - progress)) / distance`. Summed over a flight that reaches
    the goal over L metres this is 1 - detour (L / D - 1), with D the straight distance.
    Progress telescopes and no length is shorter than its progress, so circling never pays.

    Args:
        before: straight distance to the goal before the segment [m].
        after: and after it [m].
        length: of the segment [m].
        distance: straight distance from start to goal [m].
        prices: of detour and failure.
    """
    progress = before - after
    return (progress - prices.detour * (length - progress)) / distance
