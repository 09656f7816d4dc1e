"""Iterates of the search: unknowns with the window expanded there, and predictions of steps."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.sqp.expansion import Expansion, Layout, empty_expansion
from planners.optimization.sqp.turn_contacts import RADIUS_FACTOR
from planners.optimization.window import Window


@dataclass(slots=True, eq=False)
class Iterate:
    """Unknowns, and the window expanded there."""

    expansion: Expansion
    x: Array
    gradient: Array
    """(m,) of the objective."""
    hessian: Array
    """(m, m) of the Lagrangian."""
    multiplier: Array
    """(room,) of each contact, >= 0."""
    tension: Array
    """(n,) multiplier of each length: positive at the shortest, negative at the longest."""
    contacts: int = 0
    violation: float = 0.0
    """Sum of all constraint violations [m]."""
    objective: float = 0.0
    slope: Array = field(default_factory=lambda: np.empty(3))
    """(3,) gradient of the objective with respect to length and end."""
    curvature: Array = field(default_factory=lambda: np.empty((3, 3)))
    """(3, 3) Hessian of the objective with respect to the same."""


def empty_iterate(segments: int, unknowns: int, room: int) -> Iterate:
    """Memory for an iterate with up to `room` contacts."""
    return Iterate(
        expansion=empty_expansion(segments, unknowns, room),
        x=np.empty(unknowns),
        gradient=np.empty(unknowns),
        hessian=np.empty((unknowns, unknowns)),
        multiplier=np.empty(room),
        tension=np.empty(segments),
    )


class TrialStep(NamedTuple):
    """A step of the quadratic program, and what the model predicts of it."""

    p: Array
    """(m,)."""
    multipliers: Array
    """(rows,) of lengths and contacts."""
    decrease: float
    """Predicted decrease of the objective."""
    gain: float
    """The decrease plus the removed violations times their multipliers; the search ends when this
    is small."""
    size: float
    """Size of the step in the norm of the trust region."""


@compiled
def predict(
    p: Array,
    gradient: Array,
    hessian: Array,
    scale: Array,
    multipliers: Array,
    lower: Array,
    upper: Array,
) -> tuple[float, float, float]:
    """Decrease, gain and size of a step p (m,), as in `TrialStep`."""
    decrease = size = 0.0
    m = len(p)
    for i in range(m):
        size = max(size, abs(p[i]) / scale[i])
        row = 0.0
        for j in range(m):
            row += hessian[i, j] * p[j]
        decrease -= p[i] * (gradient[i] + 0.5 * row)
    gain = decrease
    for row in range(len(multipliers)):
        if multipliers[row] > 0.0:
            gain += multipliers[row] * max(0.0, lower[m + row])
        else:
            gain += multipliers[row] * min(0.0, upper[m + row])
    return decrease, gain, size


def agreement(here: Iterate, there: Iterate, decrease: float) -> float:
    """Ratio of the actual and the predicted decrease of the objective.

    For a step that mainly removes violations the ratio is 0.5. If a step removes at least a tenth
    of the violations, the ratio is at least 1e-3.
    """
    if decrease <= 1e-4 * here.violation:
        return 0.5
    ratio = (here.objective - there.objective) / decrease
    return max(ratio, 1e-3) if there.violation < 0.9 * here.violation else ratio


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
