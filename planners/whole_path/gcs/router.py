"""The router `gcs`: convex cells of the free space, and Drake's search through them.

Drake runs in a subprocess (`planners.whole_path.gcs.server`).
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
from functools import partial

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.optional_dependencies import require
from ferguson_gym.shortest_paths.scene import scene
from ferguson_gym.world import Field, transition
from planners.interface import Route
from planners.whole_path.gcs.cells import Cells, free_cells, without_detours
from planners.whole_path.gcs.polygons import circumscribed
from planners.whole_path.line_of_sight import scene_from
from planners.whole_path.subprocess_worker import Worker, shared_worker

WORKER = "planners.whole_path.gcs.server"
"""Module that runs in the subprocess."""
EXTRA = "gcs"
"""The extra that installs Drake and shapely."""
_LEFT_OUT = 1e-3
"""Part of the way from the start to the end of its cell that the curve's first control point leaves
ahead of it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Problem:
    """Request to the subprocess."""

    cells: Cells
    ahead: Array
    """Second control point of the curve in each cell that has the start (n, 2) [m]."""
    paths: int
    seed: int


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Answer:
    """Answer of the subprocess."""

    points: Array | None
    """(n, 2) corners of a route [m]; None if none was found."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Gcs:
    """Routes by Drake's `GcsTrajectoryOptimization`, with Clarabel as the solver.

    Raises:
        ValueError: fewer than 3 corners or 1 path, `timeout` is not positive, or Drake or shapely
            is not installed.
    """

    corners: int = 12
    """Corners of the polygon around a disc; a few more where passages are narrow
    (`planners.whole_path.gcs.polygons`)."""
    paths: int = 10
    """Different ways through the cells that are drawn from the relaxed solution, at most; the
    shortest is taken."""
    timeout: float = 120.0
    """Time after which the library counts as hung [s]."""
    worker: Worker = dataclasses.field(default_factory=partial(shared_worker, WORKER), repr=False)
    """Subprocess of the library; routers that share it plan one at a time."""

    def __post_init__(self) -> None:
        if self.corners < 3:
            raise ValueError(f"a polygon has at least 3 corners, got {self.corners}")
        if self.paths < 1:
            raise ValueError(f"at least 1 path must be drawn, got {self.paths}")
        if not self.timeout > 0.0:
            raise ValueError(f"timeout must be positive, got {self.timeout!r} s")
        require("gcs", "pydrake", "Drake", EXTRA)
        require("gcs", "shapely", "shapely", EXTRA)

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Plan a route (n, 2) from a vehicle to the goal; None if no route was found.

        The route enters no polygon around an obstacle, and so none of the obstacles.

        Raises:
            CrashedError: Drake crashed or did not answer in time.
            TypeError: the field is not planar.
        """
        began = time.perf_counter()
        cells = _cells(field, vehicle, self.corners)
        if cells is None:
            return None
        cells, ahead = _departing(without_detours(cells), vehicle.derivative / 3.0)
        stream = np.random.default_rng([seed, vehicle.segments])
        problem = Problem(
            cells=cells, ahead=ahead, paths=self.paths, seed=int(stream.integers(1, 2**31))
        )
        answer: Answer = self.worker.ask(problem, self.timeout)
        if answer.points is None:
            return None
        points = answer.points
        points[0], points[-1] = vehicle.position, field.goal
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return Route(points=points, length=length, progress=[(time.perf_counter() - began, length)])


def _cells(field: Field, vehicle: transition.State, corners: int) -> Cells | None:
    """The free space from a vehicle to the goal; None if they collide or are apart."""
    if scene_from(field, vehicle.position) is None or scene_from(field, field.goal) is None:
        return None
    _, kept = scene(field)
    start, goal = vehicle.position, field.goal
    polygons = circumscribed(field.obstacles.only_these(kept), corners, np.stack([start, goal]))
    # twice, for rounding
    return free_cells(polygons, field.bounds, start, goal, 2.0 * field.limits.tolerance)


def _departing(cells: Cells, ahead: Array) -> tuple[Cells, Array]:
    """The cells into which a vehicle flies first, and how far ahead it flies straight in each.

    Args:
        cells: of a field.
        ahead: of a vehicle at the start, the way (2,) to the next Bézier point [m].

    Returns:
        The cells, and the points (n, 2) where it leaves the line ahead [m]: one for each first
        cell, at the end of the way or just before the cell's.
    """
    shares = [_share_within(cells.corners[k], cells.start, ahead) for k in cells.first]
    best = max(shares)
    chosen = [(k, share) for k, share in zip(cells.first, shares, strict=True) if share == best]
    first, most = zip(*chosen, strict=True)
    points = cells.start + np.outer(most, ahead)
    return dataclasses.replace(cells, first=list(first)), points


def _share_within(corners: Array, start: Array, ahead: Array) -> float:
    """The part of a way (2,) from a start in a convex polygon that lies well inside."""
    sides = np.roll(corners, -1, axis=0) - corners
    outward = np.column_stack([sides[:, 1], -sides[:, 0]])
    room = np.maximum(((corners - start) * outward).sum(axis=1), 0.0)
    speed = outward @ ahead
    shares = np.divide(room, speed, out=np.full(len(room), np.inf), where=speed > 0.0)
    return float(min(1.0, (1.0 - _LEFT_OUT) * shares.min()))
