"""The reward of a segment; `step_kernel` subtracts the penalty for failure from it."""

from __future__ import annotations

from ferguson_gym.runtime.jit import compiled


@compiled
def segment_reward(
    before: float, after: float, length: float, distance: float, detour: float
) -> float:
    """Reward of a segment that was flown, without the penalty for failure.

    `(progress - detour (length - progress)) / distance`. The rewards of a flight of L metres that
    reaches the goal sum to 1 - detour (L / D - 1), with D the distance from the start. The progress
    of all segments sums to at most D, and a loop makes none, so loops are never rewarded. `before`
    and `after` are distances to the goal [m], straight or along the way, `distance` is that of the
    start. `detour` weighs length beyond progress; all progress together is rewarded with 1.
    """
    progress = before - after
    return (progress - detour * (length - progress)) / distance
