"""The subprocess in which Drake plans, started by `planners.whole_path.subprocess_worker`.

A cell that has the start holds a quadratic Bézier curve, whose second control point is given, so
that it leaves in the vehicle's direction. All other cells hold straight lines: with a cost of
length alone, curves of a higher degree become straight, and a continuous path derivative, which may
vanish, binds nothing. Derivatives of the flown curve, which depend on the time spent in a cell, are
not convex.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
from pydrake.geometry.optimization import GraphOfConvexSetsOptions, HPolyhedron, Point
from pydrake.planning import GcsTrajectoryOptimization
from pydrake.solvers import ClarabelSolver

from ferguson_gym.runtime.arrays import Array
from planners.whole_path.gcs.router import Answer, Problem
from planners.whole_path.subprocess_worker import serve

_STRAIGHT = 1e-9
"""Sine of the angle between two sides that count as one."""
_CHORDS = 16
"""Straight lines by which a curve is returned."""
_SHORT = 1e-6
"""Lines of a route are longer than this [m]; the solver knows points no better."""


def answer(problem: Problem) -> Answer:
    """Solve a planning problem."""
    cells = problem.cells
    program = GcsTrajectoryOptimization(2)
    start = program.AddRegions([Point(cells.start)], 0, 0.0, 0.0, "start")
    goal = program.AddRegions([Point(cells.goal)], 0, 0.0, 0.0, "goal")
    regions = [_region(corners) for corners in cells.corners]
    pairs = sorted(cells.sides)
    lines = program.AddRegions(regions, pairs, 1, 0.0, 1.0, "lines")
    curves = program.AddRegions([regions[k] for k in cells.first], [], 2, 0.0, 1.0, "curves")
    for place, ahead in enumerate(problem.ahead):
        leaving = program.AddEdges(start, curves, None, [(0, place)])
        control = leaving.edge_constituent_vertex_control_points()[1]
        for axis in range(2):
            leaving.AddEdgeConstraint(control[axis, 1] == ahead[axis])
    place_of = {k: place for place, k in enumerate(cells.first)}
    onwards = [(place_of[one], other) for one, other in pairs if one in place_of]
    if onwards:
        program.AddEdges(curves, lines, None, onwards)
    arrive = [(place_of[k], 0) for k in cells.last if k in place_of]
    if arrive:
        program.AddEdges(curves, goal, None, arrive)
    program.AddEdges(lines, goal, None, [(k, 0) for k in cells.last])
    program.AddPathLengthCost()
    path, result = program.SolvePath(start, goal, _options(problem))
    if not result.is_success():
        return Answer(points=None)
    pieces = [path.segment(k) for k in range(path.get_number_of_segments())]
    return Answer(points=_route([piece.control_points().T for piece in pieces]))


def _options(problem: Problem) -> Any:
    options = GraphOfConvexSetsOptions()
    options.convex_relaxation = True
    options.preprocessing = False  # takes a program for each edge; the cells have none to spare
    options.max_rounded_paths = problem.paths
    options.rounding_seed = problem.seed
    options.solver = options.restriction_solver = ClarabelSolver()
    return options


def _region(corners: Array) -> Any:
    """A convex polygon as an intersection of half-planes."""
    sides = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([sides[:, 1], -sides[:, 0]])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    before = np.roll(normals, 1, axis=0)
    turns = np.abs(before[:, 0] * normals[:, 1] - before[:, 1] * normals[:, 0]) > _STRAIGHT
    return HPolyhedron(normals[turns], (normals * corners).sum(axis=1)[turns])


def _route(pieces: list[Array]) -> Array:
    """Corners (n, 2) of the route along a quadratic curve (3, 2) and the lines (2, 2) after it."""
    (start, ahead, end), *lines = [piece for piece in pieces if len(piece) > 1]
    t = np.linspace(0.0, 1.0, _CHORDS + 1)[:, None]
    curve = (1.0 - t) ** 2 * start + 2.0 * t * (1.0 - t) * ahead + t**2 * end
    points = np.concatenate([curve, *(line[1:] for line in lines)])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    kept: Array = points[np.concatenate([[True], steps > _SHORT])]
    return kept


if __name__ == "__main__":
    logging.getLogger("drake").setLevel(logging.ERROR)
    serve(answer)
