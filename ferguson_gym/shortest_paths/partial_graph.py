"""The tangent graph of those obstacles that shortest paths from some points can meet.

A path of a length lies within the ellipse that has its ends as foci and that length as the sum of
distances. A shortest path among some of the obstacles is at most as long as one among all of them.
If all obstacles that reach into its ellipse are among those some, it meets no other one and is
the shortest path among all. Otherwise the obstacles that do reach in are added, and the path is
found again. So the graph grows with the queries, and obstacles far from all shortest paths cost
nothing. The same holds for every taut path up to a length, hence for homotopy classes.

Reference:
    Gammell, Srinivasa & Barfoot (2014), Informed RRT*: optimal sampling-based path planning focused
    via direct sampling of an admissible ellipsoidal heuristic, IEEE/RSJ IROS.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from ferguson_gym.shortest_paths.common_tangents import Tangents, more_tangents, tangents
from ferguson_gym.shortest_paths.scene import Scene
from ferguson_gym.shortest_paths.shapes import Integers, Records, only_these
from ferguson_gym.shortest_paths.tangent_graph import Tracks, with_lines

_GUESS = 1.02
"""Length of a shortest path for which a graph is made first, relative to the straight distance."""
_SLACK = 0.01
"""By how much lengths for which a graph is extended exceed those found, relative to them."""
_GROWTH = 1.4
"""Least factor by which the number of obstacles grows, so that few graphs are made."""
_MOST = 0.8
"""Share of all obstacles above which all of them are taken."""


class PartialGraph(NamedTuple):
    """The tangent graph of some of a scene's obstacles."""

    scene: Scene
    """Of these obstacles."""
    kept: Integers
    """(m,) the field's obstacle for each of them."""
    tracks: Tracks
    which: Integers
    """(m,) these obstacles among those of the whole scene."""
    lines: Tangents
    holds: NDArray[np.bool_]
    """(n,) whether an obstacle of the whole scene is one of them."""


@compiled_in_place
def _detour(disc: Any, goal: Array, x: float, y: float) -> float:
    """A lower bound on the length of paths from (x, y) to a goal that meet a disc [m]."""
    there = np.sqrt((disc.x - x) ** 2 + (disc.y - y) ** 2) - disc.radius
    ahead = np.sqrt((disc.x - goal[0]) ** 2 + (disc.y - goal[1]) ** 2) - disc.radius
    return float(max(there, 0.0) + max(ahead, 0.0))


@compiled
def covers(
    discs: Records,
    holds: NDArray[np.bool_],
    goal: Array,
    points: Array,
    lengths: Array,
    margin: float,
) -> NDArray[np.bool_]:
    """Whether a graph holds all obstacles that paths (m,) of some lengths from points can meet.

    Infinite lengths count as covered: where there is no path among some obstacles, there is none
    among more.
    """
    covered = np.ones(len(points), dtype=np.bool_)
    others = np.flatnonzero(~holds)
    for p in range(len(points)):
        for k in others:
            detour = _detour(discs[k], goal, points[p, 0], points[p, 1])
            if lengths[p] < np.inf and detour <= lengths[p] + margin:
                covered[p] = False
                break
    return covered


@compiled
def _relative_detours(
    discs: Records, goal: Array, points: Array, lengths: Array, margin: float
) -> Array:
    """Least detours (n,) by obstacles, over all points (m, 2), relative to some lengths (m,)."""
    least = np.full(len(discs), np.inf)
    for k in range(len(discs)):
        for p in range(len(points)):
            detour = _detour(discs[k], goal, points[p, 0], points[p, 1])
            least[k] = min(least[k], detour / (lengths[p] + margin))
    return least


def first_guess(goal: Array, points: Array) -> Array:
    """Lengths (m,) of paths from points for which a graph is made first [m]."""
    straight: Array = np.linalg.norm(points - goal, axis=1)
    return _GUESS * straight


def wider(
    scene: Scene,
    kept: Integers,
    goal: Array,
    graph: PartialGraph | None,
    points: Array,
    lengths: Array,
) -> PartialGraph:
    """A graph that covers paths of some lengths from points and has more obstacles than before.

    Args:
        scene: all obstacles.
        kept: (n,) the field's obstacle for each of them.
        goal: (2,) [m].
        graph: the graph so far.
        points: (m, 2) [m].
        lengths: (m,) [m].
    """
    n = len(scene.discs)
    holds = np.zeros(n, dtype=np.bool_) if graph is None else graph.holds.copy()
    before, known = holds.copy(), int(holds.sum())
    detours = _relative_detours(scene.discs, goal, points, lengths, scene.margin)
    detours[holds] = 0.0
    holds |= detours <= 1.0 + _SLACK
    if (least := int(np.ceil(_GROWTH * known))) > holds.sum():
        # the nearest obstacles, as many as are asked for
        holds[np.argsort(detours, kind="stable")[:least]] = True
    if holds.sum() > _MOST * n:
        holds[:] = True
    which = np.flatnonzero(holds & ~before)
    if graph is not None:
        which = np.concatenate([graph.which, which])
    shapes = only_these(scene.shapes, which) if len(scene.shapes.first) else scene.shapes
    part = Scene(scene.discs[which], scene.box, scene.margin, shapes)
    lines = tangents(part, 0) if graph is None else more_tangents(part, known, graph.lines)
    return PartialGraph(part, kept[which], with_lines(part, lines, goal), which, lines, holds)
