"""Iterates of the search: unknowns with the window expanded there, and predictions of steps."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.elastic_qp import Program
from planners.optimization.sqp.expansion import Expansion, Layout, empty_expansion
from planners.optimization.sqp.turn_contacts import RADIUS_FACTOR
from planners.optimization.window import Window

PlainLayout: TypeAlias = tuple[Any, ...]
"""`Layout` as plain tuples, which are passed to compiled functions in less time."""


class Iterate(NamedTuple):
    """Unknowns, and the window expanded there."""

    expansion: Expansion
    x: Array
    """(m,)."""
    gradient: Array
    """(m,) of the objective."""
    hessian: Array
    """(m, m) of the Lagrangian."""
    multiplier: Array
    """(room,) of each contact, >= 0."""
    tension: Array
    """(n,) multiplier of each length: positive at the shortest, negative at the longest."""
    slope: Array
    """(3,) gradient of the objective with respect to length and end."""
    curvature: Array
    """(3, 3) Hessian of the objective with respect to the same."""
    values: Array
    """(2,) objective, and the sum of all constraint violations [m]."""
    contacts: Integers
    """(1,) number of contacts."""


@compiled
def empty_iterate(segments: int, unknowns: int, room: int) -> Iterate:
    """Memory for an iterate with up to `room` contacts."""
    return Iterate(
        empty_expansion(segments, unknowns, room),
        np.empty(unknowns),
        np.empty(unknowns),
        np.empty((unknowns, unknowns)),
        np.zeros(room),
        np.zeros(segments),
        np.empty(3),
        np.empty((3, 3)),
        np.empty(2),
        np.zeros(1, np.int64),
    )


@compiled
def predict(
    p: Array, gradient: Array, hessian: Array, scale: Array, program: Program
) -> tuple[float, float, float]:
    """What the model predicts of a step p (m,).

    Returns:
        The predicted decrease of the objective; the gain, which is the decrease plus the removed
        violations times their multipliers: the search ends when this is small; and the size of
        the step in the norm of the trust region.
    """
    decrease = size = 0.0
    m = len(p)
    for i in range(m):
        size = max(size, abs(p[i]) / scale[i])
        row = 0.0
        for j in range(m):
            row += hessian[i, j] * p[j]
        decrease -= p[i] * (gradient[i] + 0.5 * row)
    gain = decrease
    for row in range(program.number[0]):
        gain += program.multipliers[row] * max(0.0, program.least[row])
    return decrease, gain, size


@compiled
def agreement(here: Array, there: Array, decrease: float) -> float:
    """Ratio of the actual and the predicted decrease of the objective, from values of iterates.

    For a step that mainly removes violations the ratio is 0.5. If a step removes at least a tenth
    of the violations, the ratio is at least 1e-3.
    """
    if decrease <= 1e-4 * here[1]:
        return 0.5
    ratio = (here[0] - there[0]) / decrease
    return float(max(ratio, 1e-3) if there[1] < 0.9 * here[1] else ratio)


def layout_of(window: Window, obstacles: Obstacles) -> Layout:
    """A window's chain and limits for compiled functions, without pinned contacts."""
    chain, limits = window.chain, window.field.limits
    centers, radii = obstacles.balls
    places = np.full(chain.free.shape, -1, np.int64)
    places[chain.free] = np.arange(chain.free.sum())
    # rows start, end, start derivative, end derivative, as in a control array
    place = np.stack([places[:-1, 0], places[1:, 0], places[:-1, 1], places[1:, 1]], axis=1)
    return Layout(
        base=chain.control(np.zeros(int(chain.free.sum()))),
        place=place.reshape(-1, 8),
        bounds=window.field.bounds,
        centers=centers,
        radii=radii,
        cores=obstacles.cores,
        slowest=limits.slowest,
        limits=np.array([limits.shortest, limits.longest]),
        bending_weight=window.bending_weight,
        correction=np.zeros(chain.segments),
        pinned_contacts=np.empty((0, 3)),
        turn_radius=RADIUS_FACTOR * window.turn_radius,
    )


@compiled
def as_layout(plain: PlainLayout) -> Layout:
    """The layout that plain tuples hold."""
    base, place, bounds, centers, radii, cores, slowest, limits = plain[:8]
    bending, correction, pinned, turn_radius = plain[8:]
    return Layout(
        base,
        place,
        bounds,
        centers,
        radii,
        Cores(*cores),
        slowest,
        limits,
        bending,
        correction,
        pinned,
        turn_radius,
    )
