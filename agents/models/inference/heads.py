"""What a policy thinks best, of its last layer: a Gaussian's mean, or a mixture's way; compiled."""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Single, exponential
from ferguson_gym.runtime.jit import compiled

LIKE = 0.08
"""How near the means of a mixture's components are that mean the same way, as actions go."""
SCALE = 0.3
"""Of a mixture's means, so that they begin where flights are flown."""

_FALL = np.float32(-1.0 / (2.0 * LIKE**2))
_SCALE, _ZERO, _ONE = np.float32(SCALE), np.float32(0.0), np.float32(1.0)


@compiled
def _clip(actions: Single) -> None:
    for i in range(actions.shape[0]):
        for d in range(actions.shape[1]):
            action = actions[i, d]  # what is no number stays so, and is refused where it is flown
            action = -_ONE if action < -_ONE else action
            actions[i, d] = _ONE if action > _ONE else action


@compiled
def mean(rows: Single, size: int) -> Single:
    """Actions (n, size) in [-1, 1]: the mean of a Gaussian, which is what the layer says."""
    actions = rows[:, :size].copy()
    _clip(actions)
    return actions


@compiled
def mode(rows: Single, size: int, components: int) -> Single:
    """Actions (n, size) in [-1, 1], as `agents.models.mixture.Mixture.mode` has them.

    Args:
        rows: (n, components (1 + 2 size)) or wider, what the layer says.
        size: of actions.
        components: of the mixture.
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
            if total > most:  # of equals the first
                most = total
                for d in range(size):
                    way = _ZERO
                    for b in range(components):
                        way += alike[b] * (_SCALE * row[b * step + 1 + d])
                    actions[i, d] = way / total
    _clip(actions)
    return actions
