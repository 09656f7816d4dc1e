"""Fitting of Ferguson chains to a route: knots on it, then all segments optimised together.

Evenly spaced knots are tried first. Where they fail, or leave a chain longer than its route, knots
are placed where the route turns, and the best chain is kept.

The route only determines on which side obstacles are passed: the chain is the shortest that the
optimiser finds nearby. So planners are compared by the homotopy class that they choose, not by how
smooth their routes are.
"""

from __future__ import annotations

import math

import numpy as np

from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from planners.optimization import MultiStart, along_route, offset_guesses
from planners.optimization.route_knots import turn_aligned
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.window import SIDE_OFFSET, SMOOTH, final_window

SPACINGS = (11.0, 9.0, 13.0, 7.0, 5.0)
"""Segment lengths of initial guesses [m], tried in turn until one leads to a chain."""
CLOSE = 1e-3
"""Excess of a chain's length over that of its route, relative to it, that needs no other guess."""
SOLVER = MultiStart(search=ElasticSqp(iterations=200), sidesteps=())


def fit(points: Array, field: Field, vehicle: transition.State) -> Array | None:
    """Fit a chain (n, 4, 2) to a route: the shortest found, certified feasible; None without one.

    It starts with the vehicle's position and derivative and ends on the goal, as do the route's
    points (m, 2) [m].
    """
    left = field.limits.segments - vehicle.segments
    if left < 1:
        return None
    best = _fit_evenly(points, field, vehicle)
    enough = (1.0 + CLOSE) * _chord_length(points)
    if best is not None and Path(best).length <= enough:
        return best
    for guess in turn_aligned(vehicle, points, field.obstacles, field.limits, left):
        chain = _optimised(guess, field, vehicle)
        if chain is not None and (best is None or Path(chain).length < Path(best).length):
            best = chain
            if Path(best).length <= enough:
                break
    return best


def _fit_evenly(points: Array, field: Field, vehicle: transition.State) -> Array | None:
    """Fit a chain from evenly spaced knots, with as many segments as its own length needs."""
    left = field.limits.segments - vehicle.segments
    chain = _fit(points, field, vehicle)
    if chain is None:
        return None
    path = Path(chain)
    if len(chain) == min(math.ceil(path.length / SPACINGS[0]), left):
        return chain
    # the number of segments must depend on the fitted path, not on the corners of the route
    again = _fit(path.points(), field, vehicle)
    return chain if again is None else again


def _fit(points: Array, field: Field, vehicle: transition.State) -> Array | None:
    """Fit a chain with about as many segments as the length of the route needs."""
    whole = _chord_length(points)
    tried: set[int] = set()
    for spacing in SPACINGS:
        left = field.limits.segments - vehicle.segments
        segments = min(max(1, math.ceil(whole / spacing)), left)
        if segments in tried:
            continue
        tried.add(segments)
        on_route = along_route(vehicle, points, segments, whole)
        # a straight guess that is too short gives the optimiser no direction in which to lengthen
        # it
        for guess in (on_route, *offset_guesses(on_route, SIDE_OFFSET)):
            chain = _optimised(guess, field, vehicle)
            if chain is not None:
                return chain
    return None


def _optimised(guess: Array, field: Field, vehicle: transition.State) -> Array | None:
    """The shortest feasible chain near a guess (n, 4, 2) that ends on the goal, None if none."""
    window = final_window(field, vehicle, SMOOTH, len(guess))
    (end,) = SOLVER.solve(window, [guess])
    return end.control if end.feasible else None


def _chord_length(points: Array) -> float:
    """The length of a route (m, 2) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
