"""Features of observations, compiled, as `agents.models.extractors` computes them."""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Single, exponential, relu
from agents.models.inference.matmul import add_product, affine
from ferguson_gym.runtime.jit import compiled

OWN = 15
"""Numbers made of goal and vehicle."""
DISC = 7
"""Numbers made of an obstacle."""
NEARER = (5.0, 14.0)
"""Distances to the goal are shown so many times larger as well, up to 1."""
FALL = 8.0
"""How steeply nearness falls with distance, in parts of the view."""
USUAL = 8.0
"""A sum over obstacles is divided by this, and stays near one for the usual dozen."""
GRAIN = 1e-3
"""Added to an obstacle's distance before its direction is formed."""

_CLOSER, _CLOSEST = (np.float32(scale) for scale in NEARER)
_STEEP, _GRAIN, _SHARE = np.float32(-FALL), np.float32(GRAIN), np.float32(1.0 / USUAL)
_ZERO, _HALF, _ONE = (np.float32(value) for value in (0.0, 0.5, 1.0))


@compiled
def _own(features: Single, i: int, at: int, goal: Single, vehicle: Single) -> None:
    """Fill in OWN numbers of a row: goal and vehicle, the goal on finer scales too."""
    for k in range(3):
        features[i, at + k] = goal[i, k]
    for k in range(6):
        features[i, at + 3 + k] = vehicle[i, k]
    for k in range(2):
        near = (_CLOSEST if k else _CLOSER) * goal[i, 0]
        near = near if near < _ONE else _ONE
        features[i, at + 9 + 3 * k] = near
        features[i, at + 10 + 3 * k] = near * goal[i, 1]
        features[i, at + 11 + 3 * k] = near * goal[i, 2]


@compiled
def _rays(features: Single, i: int, at: int, rays: Single) -> None:
    """Fill in 2 R numbers of a row: ranges, and how near their ends are."""
    number = rays.shape[1]
    for k in range(number):
        features[i, at + k] = rays[i, k]
        features[i, at + number + k] = exponential(_STEEP * rays[i, k])


@compiled
def _disc(discs: Single, i: int, seen: Single, j: int, at: int) -> None:
    """Fill in a row (DISC,): an obstacle as it is seen, its direction, and how near it is."""
    for k in range(4):
        discs[i, k] = seen[j, at + k]
    x, y = seen[j, at], seen[j, at + 1]
    away = np.sqrt(x * x + y * y) + _GRAIN
    discs[i, 4] = x / away
    discs[i, 5] = y / away
    discs[i, 6] = exponential(_STEEP * seen[j, at + 3])


@compiled
def plain(goal: Single, vehicle: Single, mask: Single, obstacles: Single, rays: Single) -> Single:
    """Features (n, OWN + K + 4 K + 2 R) as `agents.models.extractors.Plain` has them.

    Args:
        goal: (n, 3).
        vehicle: (n, 6).
        mask: (n, K); K is 0 where no obstacles are seen.
        obstacles: (n, 4 K).
        rays: (n, R); R is 0 without rays.
    """
    number, count, most = len(goal), mask.shape[1], obstacles.shape[1]
    features = np.empty((number, OWN + count + most + 2 * rays.shape[1]), np.float32)
    for i in range(number):
        _own(features, i, 0, goal, vehicle)
        for k in range(count):
            features[i, OWN + k] = mask[i, k]
        for k in range(most):
            features[i, OWN + count + k] = obstacles[i, k]
        _rays(features, i, OWN + count + most, rays)
    return features


@compiled
def sets(
    goal: Single,
    vehicle: Single,
    mask: Single,
    obstacles: Single,
    rays: Single,
    of_disc: Single,
    of_vehicle: Single,
    bias: Single,
    then: Single,
    then_bias: Single,
) -> Single:
    """Features (n, 2 width + OWN + 2 R) as `agents.models.extractors.DeepSets` has them.

    Obstacles that are not there are passed over: they would add nothing.

    Args:
        goal: (n, 3).
        vehicle: (n, 6).
        mask: (n, K).
        obstacles: (n, 4 K).
        rays: (n, R); R is 0 without rays.
        of_disc: weights (DISC, width) of the first layer for an obstacle.
        of_vehicle: weights (OWN, width) of the first layer for goal and vehicle.
        bias: (width,) of the first layer.
        then: weights (width, width) of the second layer.
        then_bias: (width,) of the second layer.
    """
    number, width = len(goal), len(bias)
    own = np.empty((number, OWN), np.float32)
    for i in range(number):
        _own(own, i, 0, goal, vehicle)
    shared = affine(own, of_vehicle, bias)
    discs = np.empty((mask.size, DISC), np.float32)
    whose = np.empty(mask.size, np.int64)
    count = 0
    for i in range(number):
        for k in range(mask.shape[1]):
            if mask[i, k] > _HALF:
                _disc(discs, count, obstacles, i, 4 * k)
                whose[count] = i
                count += 1
    first = np.empty((count, width), np.float32)
    for m in range(count):
        for j in range(width):
            first[m, j] = shared[whose[m], j]
    add_product(discs, of_disc, first)
    relu(first)
    second = affine(first, then, then_bias)
    relu(second)
    features = np.zeros((number, 2 * width + OWN + 2 * rays.shape[1]), np.float32)
    for m in range(count):
        i = whose[m]
        for j in range(width):
            each, most = second[m, j], features[i, width + j]
            features[i, j] += each * _SHARE
            features[i, width + j] = most if most > each else each
    for i in range(number):
        _own(features, i, 2 * width, goal, vehicle)
        _rays(features, i, 2 * width + OWN, rays)
    return features
