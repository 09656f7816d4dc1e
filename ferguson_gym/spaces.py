"""Spaces and specs of both environments, and checks of actions, seeds and reset options."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import real, truncate_repr
from ferguson_gym.simulation.settings import CHANGEABLE, Settings
from ferguson_gym.world.actions import Action
from ferguson_gym.world.suites import LAST_SEED


def action_space() -> spaces.Space[Action]:
    """The space of one vehicle's actions."""
    return cast("spaces.Space[Action]", spaces.Box(-1.0, 1.0, (4,), np.float32))


def observation_space(settings: Settings) -> spaces.Space[Any]:
    """The space of one vehicle's observations: by entry, or a vector if they are flat."""
    low = {"mask": 0.0, "rays": 0.0}
    boxes: dict[str, spaces.Space[Any]] = {
        key: spaces.Box(low.get(key, -1.0), 1.0, (size,), np.float32)
        for key, size in settings.layout.entries().items()
    }
    space = spaces.Dict(boxes)
    return cast("spaces.Space[Any]", spaces.flatten_space(space) if settings.flat else space)


def with_steps(spec: EnvSpec | None, settings: Settings) -> EnvSpec | None:
    """A spec that says after how many steps flights are truncated; None stays None.

    The registered spec leaves it open, since `gym.make` would add a second limit, which knows
    nothing of the argument `segments`.
    """
    if spec is None:
        return None
    return dataclasses.replace(spec, max_episode_steps=settings.max_segments)


def as_actions(action: ArrayLike, shape: tuple[int, ...]) -> Action:
    """Actions in single precision.

    Raises:
        ValueError: another shape, or entries that are not real numbers.
    """
    if type(action) is np.ndarray and action.dtype == np.float32 and action.shape == shape:
        return np.ascontiguousarray(action)
    array = real("action", action)
    if array.shape != shape:
        raise ValueError(f"action must have shape {shape}, got {array.shape}")
    with np.errstate(over="ignore"):  # infinite entries are refused later
        return array.astype(np.float32)


def as_seed(seed: object) -> int | None:
    """A seed as an int; None stays None.

    Raises:
        ValueError: not an integer from 0 to 2**63 - 1.
    """
    if seed is None:
        return None
    if type(seed) is bool or not isinstance(seed, (int, np.integer)) or not 0 <= seed <= LAST_SEED:
        raise ValueError(f"a seed is an integer from 0 to 2**63 - 1, got {truncate_repr(seed)}")
    return int(seed)


def known_options(options: object, *names: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Options of a reset: those of these names, and arguments that may change between flights.

    Raises:
        ValueError: not a mapping, or one with other keys.
    """
    if options is None:
        return {}, {}
    names = (*names, *CHANGEABLE)
    known = ", ".join(repr(name) for name in names)
    if not isinstance(options, Mapping):
        raise ValueError(
            f"reset options are a dictionary with {known}, got {truncate_repr(options)}"
        )
    if unknown := set(options) - set(names):
        raise ValueError(f"unknown reset options {sorted(unknown, key=str)}; known: {known}")
    arguments = {name: options[name] for name in options if name in CHANGEABLE}
    return {name: options[name] for name in options if name not in CHANGEABLE}, arguments
