"""Nominal chains, around which programs are written: along shortest paths, or an earlier plan.

Lengths are for fields of the paper's scale, see `planners.rescaling`.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ferguson_gym.guidance.path_tree import PathTree, look_ahead
from ferguson_gym.guidance.way import tree_of
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal, distance_to_go
from ferguson_gym.world import Field, transition
from planners.optimization.initial_guesses import shifted

_BESIDE = 0.25
"""Distance along a path over which its direction is taken, to both sides [m]."""
_LONG = 0.9
"""Length of segments, relative to the longest, that is not exceeded where enough are left."""


class Nominal(NamedTuple):
    """A chain to the goal or towards it, feasible or not."""

    control: Array
    """(n, 4, 2)."""
    final: bool
    """Whether it ends on the goal."""
    route: float
    """Length of the shortest route to the goal from its begin [m]."""
    planned: bool = False
    """Whether it begins with a plan. Others may cut through obstacles, where normals turn round."""


def nominal_chain(
    field: Field, vehicle: transition.State, stride: float, most: int
) -> Nominal | None:
    """Even segments along the shortest path; None without a path.

    Args:
        field: of the paper's scale.
        vehicle: where the chain begins.
        stride: approximate length of a segment [m]; longer where few segments are left.
        most: maximum number of segments; where so many suffice, the chain ends on the goal.
    """
    length = distance_to_go(field).departure(*vehicle.position.tolist()).distance
    if not np.isfinite(length):
        return None
    control, final = _onwards(field, vehicle, length, stride, most)
    return Nominal(control, final, length)


def extended_plan(
    field: Field, vehicle: transition.State, tail: Array, stride: float, most: int
) -> Nominal | None:
    """The rest of a plan, extended by segments along the shortest path from its end.

    None without a path, or where a further segment has no room before the goal.

    Args:
        field: of the paper's scale.
        vehicle: where the chain begins.
        tail: (m, 4, 2) rest of the plan.
        stride: approximate length of further segments [m], as in `nominal_chain`.
        most: maximum number of segments, as in `nominal_chain`.
    """
    begun = shifted(vehicle, tail, len(tail))
    end = transition.State(begun[-1, 1], begun[-1, 3], vehicle.segments + len(tail))
    togo = distance_to_go(field)
    route, rest = (
        togo.departure(*place.tolist()).distance for place in (vehicle.position, end.position)
    )
    if not np.isfinite(route) or not field.limits.shortest <= rest < np.inf:
        return None
    more, final = _onwards(field, end, rest, stride, max(most - len(begun), 1))
    return Nominal(np.concatenate([begun, more]), final, route, planned=True)


def nominal_along(
    points: Array, length: float, vehicle: transition.State, field: Field, stride: float
) -> Nominal:
    """Even segments along a route to the goal.

    Args:
        points: (m, 2) of the route from the vehicle to the goal, close to each other [m].
        length: of the route [m].
        vehicle: where the chain begins.
        field: whose goal it is.
        stride: approximate length of a segment [m].
    """
    left = max(1, field.limits.segments - vehicle.segments)
    number = min(max(1, round(length / stride)), left)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    knots = float(along[-1]) / number * np.arange(1.0, number + 1.0)
    beside = _beside(knots)
    places = np.stack([np.interp(beside, along, points[:, d]) for d in range(2)], axis=1)
    return Nominal(_through(places, vehicle, knots[0], field, True), True, length)


def _onwards(
    field: Field, begin: transition.State, length: float, stride: float, most: int
) -> tuple[Array, bool]:
    """Even segments along the shortest path, which has a length, and whether they end on the goal.

    Arguments are those of `nominal_chain`.
    """
    left = max(1, field.limits.segments - begin.segments)
    least = math.ceil(length / (_LONG * field.limits.longest))
    number = min(max(round(length / stride), least, 1), left)
    final = number <= most
    knots = length / number * np.arange(1.0, min(number, most) + 1.0)
    places = _ahead(distance_to_go(field), begin.position, _beside(knots))
    return _through(places, begin, knots[0], field, final), final


def _beside(knots: Array) -> Array:
    """Distances along a path just before, at and just after knots: (3 n,) [m]."""
    beside: Array = (knots[:, None] + [-_BESIDE, 0.0, _BESIDE]).ravel()
    return beside


def _through(
    places: Array, vehicle: transition.State, speed: float, field: Field, final: bool
) -> Array:
    """Segments through knots, given with the places just before and after each: (3 n, 2) [m]."""
    before, here, after = places.reshape(-1, 3, 2).swapaxes(0, 1)
    slopes = after - before
    slopes *= speed / np.maximum(np.sqrt((slopes * slopes).sum(axis=1, keepdims=True)), 1e-12)
    control = np.empty((len(here), 4, 2))
    control[0, 0], control[0, 2] = vehicle.position, vehicle.derivative
    control[1:, 0], control[1:, 2] = here[:-1], slopes[:-1]
    control[:, 1], control[:, 3] = here, slopes
    if final:
        control[-1, 1] = field.goal
    return control


def _ahead(togo: DistanceToGoal, position: Array, distances: Array) -> Array:
    """Points (n, 2) [m] at distances (n,) along the shortest path, which exists."""
    tree = _tree(togo)
    if tree is None:
        path = togo.path(position)
        assert path is not None
        return path.at(distances)
    places, length = np.empty((1, len(distances), 2)), np.empty(1)
    look_ahead(tree, position[None], distances[None], places, length)
    ahead: Array = places[0]
    return ahead


@lru_cache(maxsize=2)
def _tree(togo: DistanceToGoal) -> PathTree | None:
    return tree_of(togo)
