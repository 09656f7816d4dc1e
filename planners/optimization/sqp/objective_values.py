"""The objectives of windows, as compiled searches take them: one type for all kinds."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.goal_search.search import GoalSearch
from ferguson_gym.shortest_paths.partial_graph import PartialGraph
from ferguson_gym.shortest_paths.scene import DISC, Scene
from ferguson_gym.shortest_paths.shapes import Shapes, no_shapes
from ferguson_gym.shortest_paths.tangent_graph import Tracks
from planners.optimization.distance_objective import NO_TRACKS, ToGoObjective, expand_togo
from planners.optimization.objectives import (
    HorizonObjective,
    LengthObjective,
    Objective,
    expand_horizon,
)

_LENGTH, _HORIZON, _TO_GO = 0, 1, 2


class ObjectiveValues(NamedTuple):
    """An objective of any kind; those that a kind does not need are empty."""

    kind: int
    """Of the length alone, of the paper's look-ahead windows, or with the cost-to-go."""
    start: Array
    """(2,) [m]."""
    goal: Array
    """(2,) [m]."""
    alpha: float
    """Weight of directness."""
    scene: Scene
    tracks: Tracks
    tolerance: float
    """Of points in obstacles [m]."""
    blocked: float
    """Cost-to-go where no path is found [m]."""


PlainObjective: TypeAlias = tuple[Any, ...]
"""`ObjectiveValues` as plain tuples, which are passed to compiled functions in less time."""


def objective_values(objective: Objective, graph: PartialGraph | None = None) -> PlainObjective:
    """The values of an objective; paths of its cost-to-go come from a graph, if one is given.

    Raises:
        TypeError: an objective that compiled searches do not know.
    """
    if isinstance(objective, ToGoObjective):
        togo = objective.togo
        return _togo_values(togo) if graph is None else _values_of(togo, graph.scene, graph.tracks)
    none, tracks = np.zeros(2), tuple(NO_TRACKS)
    scene = np.empty(0, DISC), np.empty((2, 2)), 0.0, tuple(no_shapes())
    if isinstance(objective, HorizonObjective):
        points = np.array(objective.start, float), np.array(objective.goal, float)
        return _HORIZON, *points, float(objective.alpha), scene, tracks, 0.0, 0.0
    if isinstance(objective, LengthObjective):
        return _LENGTH, none, none, 0.0, scene, tracks, 0.0, 0.0
    raise TypeError(f"searches know no objective of class {type(objective).__name__}")


@lru_cache(maxsize=2)
def _togo_values(togo: DistanceToGoal) -> PlainObjective:
    return _values_of(togo, togo.scene, NO_TRACKS if togo.tracks is None else togo.tracks)


def _values_of(togo: DistanceToGoal, obstacles: Scene, graph: Tracks) -> PlainObjective:
    (discs, box, margin, shapes), goal, tracks = obstacles, np.array(togo.field.goal), tuple(graph)
    scene, blocked = (discs, box, margin, tuple(shapes)), ToGoObjective(togo).blocked
    return _TO_GO, np.zeros(2), goal, 0.0, scene, tracks, togo.tolerance, blocked


@compiled
def as_objective(plain: PlainObjective) -> ObjectiveValues:
    """The values that plain tuples hold."""
    kind, start, goal, alpha, (discs, box, margin, shapes), tracks, tolerance, blocked = plain
    scene = Scene(discs, box, margin, Shapes(*shapes))
    return ObjectiveValues(kind, start, goal, alpha, scene, Tracks(*tracks), tolerance, blocked)


@compiled_in_place
def expand_objective(
    objective: ObjectiveValues,
    search: GoalSearch | None,
    length: float,
    end: Array,
    slope: Array,
    curvature: Array,
) -> tuple[GoalSearch | None, float]:
    """F of a length and an end (2,), and the search from the goal, continued, if there is one.

    Fills the gradient (3,) and Hessian (3, 3) with respect to both.
    """
    after, value = search, length
    first, second = np.zeros(3), np.zeros((3, 3))
    first[0] = 1.0
    if objective.kind == _TO_GO:
        after, value, first, second = expand_togo(
            length,
            end[0],
            end[1],
            objective.scene,
            objective.tracks,
            search,
            objective.goal,
            objective.tolerance,
            objective.blocked,
        )
    elif objective.kind == _HORIZON:
        start, goal, alpha = objective.start, objective.goal, objective.alpha
        value, first, second = expand_horizon(length, end, start, goal, alpha)
    for i in range(3):
        slope[i] = first[i]
        for j in range(3):
            curvature[i, j] = second[i, j]
    return after, value
