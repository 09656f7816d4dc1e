"""Compiled heads: deterministic actions from the last layer, for a Gaussian or a mixture."""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Float32Array, exponential
from ferguson_gym.runtime.jit import compiled

AGREEMENT = 0.08
"""Length scale on which two components of a mixture count as one mode, in units of actions."""
MEAN_SCALE = 0.3
"""Scale of a mixture's means: initial ones then lie in the range of usual actions."""

_FALL = np.float32(-1.0 / (2.0 * AGREEMENT**2))
_SCALE, _ZERO, _ONE = np.float32(MEAN_SCALE), np.float32(0.0), np.float32(1.0)


@compiled
def _clip(actions: Float32Array) -> None:
    for i in range(actions.shape[0]):
        for d in range(actions.shape[1]):
            action = actions[i, d]  # NaN passes; the environment refuses it
            action = -_ONE if action < -_ONE else action
            actions[i, d] = _ONE if action > _ONE else action


@compiled
def gaussian_mode(rows: Float32Array, size: int) -> Float32Array:
    """Actions (n, size) in [-1, 1]: the mean of a Gaussian, which is the output of the layer."""
    actions = rows[:, :size].copy()
    _clip(actions)
    return actions


@compiled
def mixture_mode(rows: Float32Array, size: int, components: int) -> Float32Array:
    """Actions (n, size) in [-1, 1] as `agents.models.mixture.Mixture.mode` computes them.

    Args:
        rows: (n, components (1 + 2 size)) or wider, output of the layer.
        size: number of entries of an action.
        components: number of Gaussians.
    """
    step = 1 + 2 * size
    actions = np.full((len(rows), size), np.nan, np.float32)
    weights, alike = np.empty(components, np.float32), np.empty(components, np.float32)
    for i in range(len(rows)):
        row = rows[i]
        highest = row[0]
        for a in range(1, components):
            highest = max(highest, row[a * step])
        for a in range(components):
            weights[a] = exponential(row[a * step] - highest)
        most = -_ONE
        for a in range(components):
            total = _ZERO
            for b in range(components):
                apart = _ZERO
                for d in range(1, 1 + size):
                    away = _SCALE * row[a * step + d] - _SCALE * row[b * step + d]
                    apart += away * away
                alike[b] = exponential(_FALL * apart) * weights[b]
                total += alike[b]
            if total > most:  # the first of equals
                most = total
                for d in range(size):
                    way = _ZERO
                    for b in range(components):
                        way += alike[b] * (_SCALE * row[b * step + 1 + d])
                    actions[i, d] = way / total
    _clip(actions)
    return actions
