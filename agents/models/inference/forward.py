"""Forward pass of an actor network by compiled kernels, without torch."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TypeAlias

import numpy as np

from agents.models.architecture import ACTION_SIZE, Architecture
from agents.models.inference import features, heads
from agents.models.inference.activations import ACTIVATIONS, Float32Array
from agents.models.inference.matmul import affine
from agents.models.weights import Weights
from ferguson_gym.simulation import Observation
from ferguson_gym.world import Action

_Layer: TypeAlias = tuple[Float32Array, Float32Array]
"""Weights (in, out) and bias (out,)."""
_Features: TypeAlias = Callable[[Observation], Float32Array]


class CompiledNetwork:
    """An actor network that runs without torch (an `agents.models.model.Network`).

    Args:
        architecture: sizes and kinds of the layers.
        weights: arrays of the names and shapes of `architecture.shapes`; others are ignored.
    """

    def __init__(self, architecture: Architecture, weights: Weights) -> None:
        self._features = _features(architecture, weights)
        names = [f"mlp_extractor.policy_net.{2 * n}" for n in range(len(architecture.hidden))]
        self._hidden = [_layer(weights, name) for name in names]
        self._last = _layer(weights, "action_net")
        self._activate = ACTIVATIONS[architecture.activation]
        self._components = architecture.components

    def act(self, observation: Observation) -> Action:
        """Deterministic actions (n, 4) of entries (n, size), each independent of other rows."""
        rows = self._features(observation)
        for layer in self._hidden:
            rows = affine(rows, *layer)
            self._activate(rows)
        rows = affine(rows, *self._last)
        if self._components is None:
            return heads.gaussian_mode(rows, ACTION_SIZE)
        return heads.mixture_mode(rows, ACTION_SIZE, self._components)

    def session(self) -> AbstractContextManager[None]:
        """Context for many calls; nothing needs to be prepared."""
        return nullcontext()


def _layer(weights: Weights, name: str) -> _Layer:
    return _transposed(weights[f"{name}.weight"]), weights[f"{name}.bias"].copy()


def _transposed(matrix: Float32Array) -> Float32Array:
    """A weight matrix (out, in) of torch as a contiguous (in, out)."""
    return np.array(matrix.T, order="C")


def _features(architecture: Architecture, weights: Weights) -> _Features:
    """The function that computes features (n, features) of an observation."""
    if architecture.width is None:
        return lambda observation: features.plain(*_entries(observation))
    of_disc, bias = _layer(weights, "features_extractor.obstacle")
    of_vehicle = _transposed(weights["features_extractor.vehicle.weight"])
    layers = (of_disc, of_vehicle, bias, *_layer(weights, "features_extractor.then"))
    return lambda observation: features.sets(*[*_entries(observation), *layers])


def _entries(observation: Observation) -> list[Float32Array]:
    """Goal, vehicle, mask, obstacles, rays and way; entries not observed have no columns."""
    nothing = np.empty((len(observation["goal"]), 0), np.float32)
    keys = ("goal", "vehicle", "mask", "obstacles", "rays", "way")
    return [np.ascontiguousarray(observation.get(key, nothing), np.float32) for key in keys]
