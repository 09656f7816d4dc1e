"""What the learnability benchmark compares: variants of observation, action, reward and learner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium import spaces

from ferguson_gym.world.actions import decode, encode

CHOSEN: dict[str, Any] = {"observation": "rays"}
"""Arguments of the environment, where a variant does not say otherwise."""

LEARNER: dict[str, Any] = {
    "n_steps": 32,
    "batch_size": 512,
    "n_epochs": 8,
    "learning_rate": 5e-4,
    "gamma": 0.9,
    "gae_lambda": 0.9,
}
REFINING: dict[str, Any] = {
    "n_steps": 128,
    "batch_size": 2048,
    "n_epochs": 5,
    "learning_rate": 4e-4,
    "gamma": 0.95,
    "gae_lambda": 0.95,
    "ent_coef": 1e-3,
}
"""The learner's later phases."""

Change = Callable[[Any], Any]


def as_it_is(value: Any) -> Any:
    """No change."""
    return value


def slopes_stay(actions: Any) -> Any:
    """Actions whose end derivative does not turn with the end point."""
    return np.array([_slope_stays(action) for action in within_bounds(actions)])


def _slope_stays(action: Any) -> Any:
    here, forward = np.zeros(2), np.array([1.0, 0.0])
    segment = decode(action, here, forward, goal=here, gate=0.0)
    # of an end point straight ahead, which turns nothing
    segment[3] = decode([0.0, 0.0, *action[2:]], here, forward, goal=here, gate=0.0)[3]
    try:
        return encode(segment, here, forward)
    except ValueError:  # steeper than any feasible segment
        return action


def _both_ways(*entries: float) -> Any:
    return np.array([*(-entry for entry in reversed(entries)), 0.0, *entries])


CHOICES = (
    np.array([-0.6, -0.45, -0.3, -0.1, 0.15]),
    _both_ways(0.04, 0.08, 0.13, 0.19, 0.27, 0.38, 0.55),
    np.array([-0.2, -0.08, 0.0, 0.08]),
    _both_ways(0.05, 0.12, 0.22, 0.38),
)
"""Values of each entry of an action that a policy of categories chooses from: where flights are
flown, finest at small turns."""


def chosen_values(actions: Any) -> Any:
    """Actions (n, 4) for the indices of values in `CHOICES`."""
    columns = zip(CHOICES, np.asarray(actions).T, strict=True)
    return np.stack([values[index.astype(int)] for values, index in columns], axis=1)


def within_bounds(actions: Any) -> Any:
    """Actions of a Gaussian policy, clipped."""
    return np.clip(actions, -1.0, 1.0)


def a_third(actions: Any) -> Any:
    """Actions that stay near straight flight."""
    return within_bounds(actions) / 3.0


def in_the_world(seen: Any) -> Any:
    """Flat observations of discs, in axes that do not turn with the vehicle."""
    seen = seen.copy()
    cos, sin = seen[:, -4, None], seen[:, -3, None]
    first = 3 + (seen.shape[1] - 9) // 5
    rows = np.arange(first, seen.shape[1] - 6, 4)
    ahead, left = np.r_[1, rows], np.r_[2, rows + 1]
    x, y = seen[:, ahead], seen[:, left]
    seen[:, ahead], seen[:, left] = cos * x - sin * y, sin * x + cos * y
    return seen


@dataclass(frozen=True, kw_only=True)
class Variant:
    """What differs from the chosen settings."""

    environment: dict[str, Any] = field(default_factory=dict)
    learner: dict[str, Any] = field(default_factory=dict)
    see: Change = as_it_is
    """Of flat observations (n, size)."""
    act: Change = within_bounds
    """Of a policy's actions, to those of the environment (n, 4)."""
    space: spaces.Space[Any] | None = None
    """What a policy acts in, if not in the environment's actions."""
    before: dict[str, Any] | None = None
    """Arguments of the environment in the first half of the steps: a curriculum."""


CATEGORIES: dict[str, Any] = {
    "act": chosen_values,
    "space": spaces.MultiDiscrete([len(values) for values in CHOICES]),
}
"""A policy that chooses each entry of an action from a few, and need not stay with one of two
ways past an obstacle while it learns."""

VARIANTS: dict[str, Variant] = {
    "chosen": Variant(),
    "32 rays": Variant(environment={"rays": 32}),
    "16 rays": Variant(environment={"rays": 16}),
    "12 discs": Variant(environment={"observation": "discs"}),
    "6 discs": Variant(environment={"observation": "discs", "nearest": 6}),
    "12 discs, nearest to a point 9 m ahead": Variant(
        environment={"observation": "discs", "focus": 9.0}
    ),
    "12 discs, world's frame": Variant(environment={"observation": "discs"}, see=in_the_world),
    "end derivative does not turn": Variant(act=slopes_stay),
    "a third of the action": Variant(act=a_third),
    "categories": Variant(**CATEGORIES),
    "detour 0.5, failure 1": Variant(environment={"detour": 0.5, "failure": 1.0}),
    "detour 1, failure 1": Variant(environment={"detour": 1.0, "failure": 1.0}),
    "detour 4, failure 0.5": Variant(environment={"failure": 0.5}),
    "detour 4, failure 1": Variant(environment={"failure": 1.0}),
    "detour 4, failure 4": Variant(environment={"failure": 4.0}),
    "detour 8, failure 2": Variant(environment={"detour": 8.0}),
    "discount 0.99": Variant(learner={"gamma": 0.99, "gae_lambda": 0.95}),
    "discount 0.97": Variant(learner={"gamma": 0.97, "gae_lambda": 0.95}),
    "sparse fields first": Variant(before={"suite": "sparse"}),
}


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A part of a training."""

    until: float
    """Its end, part of the time."""
    variant: Variant


PHASES = (
    Phase(until=0.1, variant=Variant(learner={"ent_coef": 2e-3}, **CATEGORIES)),
    *(
        Phase(
            until=until,
            variant=Variant(
                environment={"failure": failure, "detour": 6.0}, learner=REFINING, **CATEGORIES
            ),
        )
        for until, failure in ((0.6, 4.0), (1.0, 8.0))
    ),
)
"""Failure grows dearer as flights grow shorter."""
