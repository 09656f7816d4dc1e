"""Networks that fly without torch: compiled, and the same answer to a row in any batch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

import numpy as np

from agents.models.architecture import ACTION, Architecture
from agents.models.inference import features, heads
from agents.models.inference.activations import ACTIVATIONS, Single
from agents.models.inference.matmul import affine
from agents.models.weights import Weights
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.world.actions import Action

_Layer: TypeAlias = tuple[Single, Single]
"""Weights (in, out) and bias (out,)."""


class Forward:
    """An actor as numbers (`agents.models.model.Network`); it does what it thinks best.

    Args:
        architecture: what it is made of.
        weights: of the shapes that the architecture has; others are not looked at.
    """

    def __init__(self, architecture: Architecture, weights: Weights) -> None:
        self._features = _features(architecture, weights)
        actor = [
            _layer(weights, f"mlp_extractor.policy_net.{2 * number}")
            for number in range(len(architecture.hidden))
        ]
        self._hidden, self._last = actor, _layer(weights, "action_net")
        self._activate = ACTIVATIONS[architecture.activation]
        self._components = architecture.components

    def act(self, seen: Observation) -> Action:
        """The actions (n, 4); of each row the same, whatever the others.

        Args:
            seen: (n, size) of each entry.
        """
        rows = self._features(seen)
        for layer in self._hidden:
            rows = affine(rows, *layer)
            self._activate(rows)
        rows = affine(rows, *self._last)
        if self._components is None:
            return heads.mean(rows, ACTION)
        return heads.mode(rows, ACTION, self._components)

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """Nothing is to be prepared."""
        yield


def _layer(weights: Weights, name: str) -> _Layer:
    return _turned(weights[f"{name}.weight"]), weights[f"{name}.bias"].copy()


def _turned(matrix: Single) -> Single:
    """A matrix (out, in), as torch has it, as (in, out)."""
    return np.array(matrix.T, order="C")


def _features(architecture: Architecture, weights: Weights) -> Callable[[Observation], Single]:
    """What makes features (n, features) of an observation."""
    if architecture.width is None:
        return lambda seen: features.plain(*_entries(seen))
    of_disc, bias = _layer(weights, "features_extractor.obstacle")
    of_vehicle = _turned(weights["features_extractor.vehicle.weight"])
    layers = (of_disc, of_vehicle, bias, *_layer(weights, "features_extractor.then"))
    return lambda seen: features.sets(*_entries(seen), *layers)


def _entries(seen: Observation) -> tuple[Single, Single, Single, Single, Single]:
    """Goal, vehicle, mask, obstacles and rays, without columns where they are not seen."""
    nothing = np.empty((len(seen["goal"]), 0), np.float32)
    goal, vehicle, mask, obstacles, rays = (
        np.ascontiguousarray(seen.get(key, nothing), np.float32)
        for key in ("goal", "vehicle", "mask", "obstacles", "rays")
    )
    return goal, vehicle, mask, obstacles, rays
