"""Compiled features of observations; `agents.models.extractors` computes the same in torch."""

from __future__ import annotations

import numpy as np

from agents.models.inference.activations import Float32Array, exponential, relu
from agents.models.inference.matmul import add_product, affine
from ferguson_gym.runtime.jit import compiled

VEHICLE_SIZE = 15
"""Number of features of goal and vehicle."""
DISC_SIZE = 7
"""Number of features of an obstacle before the deep-sets layers."""
GOAL_SCALES = (5.0, 14.0)
"""Factors at which the distance to the goal is added on finer scales, clamped to 1."""
NEARNESS_DECAY = 8.0
"""Decay rate of nearness with distance, per length of the view."""
POOL_SCALE = 8.0
"""Divisor of the sum over obstacles, which keeps it near one for a dozen of them."""
WAY_SCALE = 3.0
"""Factor at which the distance to go is added on a finer scale, clamped to 1."""
DIRECTION_OFFSET = 1e-3
"""Added to the distance of an obstacle before the division that gives its direction."""

_CLOSER, _CLOSEST = (np.float32(scale) for scale in GOAL_SCALES)
_DECAY, _OFFSET, _POOL = (
    np.float32(-NEARNESS_DECAY),
    np.float32(DIRECTION_OFFSET),
    np.float32(1.0 / POOL_SCALE),
)
_FINER = np.float32(WAY_SCALE)
_ZERO, _HALF, _ONE = (np.float32(value) for value in (0.0, 0.5, 1.0))


@compiled
def _own(
    features: Float32Array, i: int, at: int, goal: Float32Array, vehicle: Float32Array
) -> None:
    """Write VEHICLE_SIZE features of row i: goal and vehicle, the goal on finer scales too."""
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
def _rays(features: Float32Array, i: int, at: int, rays: Float32Array) -> None:
    """Write 2 R features of row i: ranges of the rays and the nearness of their ends."""
    number = rays.shape[1]
    for k in range(number):
        features[i, at + k] = rays[i, k]
        features[i, at + number + k] = exponential(_DECAY * rays[i, k])


def way_size(entry: int) -> int:
    """Number of features of the way, whose entry has so many values."""
    return entry + 1 if entry else 0


@compiled
def _way(features: Float32Array, i: int, at: int, way: Float32Array) -> None:
    """Write 2 N + 3 features of row i: points in multiples of their distance, distances to go."""
    entry = way.shape[1]
    if entry == 0:
        return
    points = entry // 2 - 1
    for k in range(points):
        nearer = np.float32(points / (k + 1.0))
        features[i, at + 2 * k] = nearer * way[i, 2 * k]
        features[i, at + 2 * k + 1] = nearer * way[i, 2 * k + 1]
    features[i, at + entry - 2] = way[i, entry - 2]
    features[i, at + entry - 1] = way[i, entry - 1]
    finer = _FINER * way[i, entry - 2]
    features[i, at + entry] = finer if finer < _ONE else _ONE


@compiled
def _disc(discs: Float32Array, i: int, obstacles: Float32Array, j: int, at: int) -> None:
    """Write row i (DISC_SIZE,): an obstacle's entries, its direction and its nearness."""
    for k in range(4):
        discs[i, k] = obstacles[j, at + k]
    x, y = obstacles[j, at], obstacles[j, at + 1]
    away = np.sqrt(x * x + y * y) + _OFFSET
    discs[i, 4] = x / away
    discs[i, 5] = y / away
    discs[i, 6] = exponential(_DECAY * obstacles[j, at + 3])


@compiled
def plain(
    goal: Float32Array,
    vehicle: Float32Array,
    mask: Float32Array,
    obstacles: Float32Array,
    rays: Float32Array,
    way: Float32Array,
) -> Float32Array:
    """Features (n, VEHICLE_SIZE + K + 4 K + 2 R + W) of `agents.models.extractors.Plain`.

    Args:
        goal: (n, 3).
        vehicle: (n, 6).
        mask: (n, K); K is 0 if obstacles are not observed.
        obstacles: (n, 4 K).
        rays: (n, R); R is 0 without rays.
        way: (n, 2 N + 2), or (n, 0) without a way, for W = 2 N + 3 or 0 features.
    """
    number, count, most = len(goal), mask.shape[1], obstacles.shape[1]
    before = VEHICLE_SIZE + count + most + 2 * rays.shape[1]
    size = before + (way.shape[1] + 1 if way.shape[1] > 0 else 0)
    features = np.empty((number, size), np.float32)
    for i in range(number):
        _own(features, i, 0, goal, vehicle)
        for k in range(count):
            features[i, VEHICLE_SIZE + k] = mask[i, k]
        for k in range(most):
            features[i, VEHICLE_SIZE + count + k] = obstacles[i, k]
        _rays(features, i, VEHICLE_SIZE + count + most, rays)
        _way(features, i, before, way)
    return features


@compiled
def sets(
    goal: Float32Array,
    vehicle: Float32Array,
    mask: Float32Array,
    obstacles: Float32Array,
    rays: Float32Array,
    way: Float32Array,
    of_disc: Float32Array,
    of_vehicle: Float32Array,
    bias: Float32Array,
    then: Float32Array,
    then_bias: Float32Array,
) -> Float32Array:
    """Features (n, 2 width + VEHICLE_SIZE + 2 R + W) of `agents.models.extractors.DeepSets`.

    Padding rows are skipped, because they add nothing.

    Args:
        goal: (n, 3).
        vehicle: (n, 6).
        mask: (n, K).
        obstacles: (n, 4 K).
        rays: (n, R); R is 0 without rays.
        way: (n, 2 N + 2), or (n, 0) without a way, for W = 2 N + 3 or 0 features.
        of_disc: weights (DISC_SIZE, width) of the first layer for an obstacle.
        of_vehicle: weights (VEHICLE_SIZE, width) of the first layer for goal and vehicle.
        bias: (width,) of the first layer.
        then: weights (width, width) of the second layer.
        then_bias: (width,) of the second layer.
    """
    number, width = len(goal), len(bias)
    own = np.empty((number, VEHICLE_SIZE), np.float32)
    for i in range(number):
        _own(own, i, 0, goal, vehicle)
    shared = affine(own, of_vehicle, bias)
    discs = np.empty((mask.size, DISC_SIZE), np.float32)
    owner = np.empty(mask.size, np.int64)
    count = 0
    for i in range(number):
        for k in range(mask.shape[1]):
            if mask[i, k] > _HALF:
                _disc(discs, count, obstacles, i, 4 * k)
                owner[count] = i
                count += 1
    first = np.empty((count, width), np.float32)
    for m in range(count):
        for j in range(width):
            first[m, j] = shared[owner[m], j]
    add_product(discs, of_disc, first)
    relu(first)
    second = affine(first, then, then_bias)
    relu(second)
    before = 2 * width + VEHICLE_SIZE + 2 * rays.shape[1]
    size = before + (way.shape[1] + 1 if way.shape[1] > 0 else 0)
    features = np.zeros((number, size), np.float32)
    for m in range(count):
        i = owner[m]
        for j in range(width):
            each, most = second[m, j], features[i, width + j]
            features[i, j] += each * _POOL
            features[i, width + j] = most if most > each else each
    for i in range(number):
        _own(features, i, 2 * width, goal, vehicle)
        _rays(features, i, 2 * width + VEHICLE_SIZE, rays)
        _way(features, i, before, way)
    return features
