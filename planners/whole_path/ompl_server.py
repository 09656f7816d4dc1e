"""The subprocess in which OMPL plans, started by `planners.whole_path.subprocess_worker`.

All objects of OMPL are created for each problem after its seed is set, so that its random numbers
do not depend on earlier problems. OMPL calls Python for collision checks (a hundred thousand per
second) and, before each iteration, for the termination condition.

Reference:
    LaValle & Kuffner (2001), Randomized kinodynamic planning, IJRR 20(5): RRT, here without
    dynamics. Karaman & Frazzoli (2011), Sampling-based algorithms for optimal motion planning, IJRR
    30(7): RRT*. Kavraki, Svestka, Latombe & Overmars (1996), Probabilistic roadmaps for path
    planning in high-dimensional configuration spaces, IEEE Transactions on Robotics and Automation
    12(4): PRM. Gammell, Barfoot & Srinivasa (2020), Batch Informed Trees, IJRR 39(5): BIT*.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from ompl import base, geometric, util
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.scene import DISC
from ferguson_gym.shortest_paths.shapes import no_shapes
from planners.interface import Iterations
from planners.whole_path.line_of_sight import Barriers, keeps_clear
from planners.whole_path.ompl import Algorithm, Answer, Problem
from planners.whole_path.subprocess_worker import serve


class ExactMotionValidator(base.MotionValidator):  # type: ignore[misc]
    """Exact collision check of straight lines against obstacles."""

    def __init__(self, space: Any, barriers: Barriers) -> None:
        super().__init__(space)
        self._barriers = barriers

    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802  (OMPL's name)
        """Whether a line is free; it is inside the bounds if its ends are."""
        return keeps_clear(start[0], start[1], end[0], end[1], *self._barriers)


class Progress:
    """The budget of a problem, and the lengths of the routes found so far."""

    def __init__(self, problem: Problem) -> None:
        self._began = time.perf_counter()
        self._budget = problem.budget
        self.lengths: list[tuple[float, float]] = []

    @property
    def seconds(self) -> float:
        """Time since planning began [s]."""
        return time.perf_counter() - self._began

    def exhausted(self, iterations: int, ahead: float = 0.0) -> bool:
        """Whether the budget is used up after `iterations`, with `ahead` more seconds of work."""
        if isinstance(self._budget, Iterations):
            return iterations >= self._budget.count
        return self.seconds + ahead >= self._budget.seconds

    def record(self, length: float) -> None:
        """Record a length [m] if it is the shortest so far."""
        if length < (self.lengths[-1][1] if self.lengths else math.inf):
            self.lengths.append((self.seconds, length))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A planning problem as objects of OMPL."""

    space: Any
    """OMPL's `SpaceInformation`."""
    definition: Any
    """OMPL's `ProblemDefinition`."""

    @classmethod
    def of(cls, problem: Problem) -> Task:
        """Set up a problem."""
        plane = base.RealVectorStateSpace(2)
        box = base.RealVectorBounds(2)
        box.low, box.high = problem.bounds.tolist()
        plane.setBounds(box)
        space = base.SpaceInformation(plane)
        barriers = problem.barriers

        def is_free(state: Any) -> bool:
            x, y = state[0], state[1]
            return keeps_clear(x, y, x, y, *barriers)

        space.setStateValidityChecker(is_free)
        space.setMotionValidator(ExactMotionValidator(space, barriers))
        space.setup()
        definition = base.ProblemDefinition(space)
        ends = [space.allocState(), space.allocState()]
        for end, point in zip(ends, (problem.start, problem.goal), strict=True):
            end[0], end[1] = point.tolist()
        definition.setStartAndGoalStates(*ends)
        definition.setOptimizationObjective(base.PathLengthOptimizationObjective(space))
        return cls(space, definition)

    def planner(self, algorithm: Any) -> Any:
        """One of OMPL's planners, ready to solve the problem."""
        planner = algorithm(self.space)
        planner.setProblemDefinition(self.definition)
        planner.setup()
        return planner


def rrt(task: Task, progress: Progress) -> Array | None:
    """RRT: grow a tree from the start until it reaches the goal."""
    iterations = itertools.count()
    planner = task.planner(geometric.RRT)
    planner.solve(base.PlannerTerminationCondition(lambda: progress.exhausted(next(iterations))))
    return solution(task)


def rrt_star(task: Task, progress: Progress) -> Array | None:
    """RRT*: grow a tree and rewire it towards shorter paths."""
    iterations = itertools.count()
    planner = task.planner(geometric.RRTstar)

    def stop() -> bool:
        progress.record(planner.bestCost().value())
        return progress.exhausted(next(iterations))

    planner.solve(base.PlannerTerminationCondition(stop))
    return solution(task)


def bit_star(task: Task, progress: Progress) -> Array | None:
    """BIT*: search batches of samples in the order of potential path length."""
    planner = task.planner(geometric.BITstar)

    def stop() -> bool:
        progress.record(planner.bestCost().value())
        return progress.exhausted(planner.numBatches() - 1)  # the last batch is unfinished

    planner.solve(base.PlannerTerminationCondition(stop))
    return solution(task)


def prm(task: Task, progress: Progress) -> Array | None:
    """PRM: let OMPL grow a roadmap, and search it each time its size has doubled.

    OMPL's own search runs concurrently, timed by the clock. The roadmap would then differ between
    runs with the same seed, and two threads would call Python.
    """
    planner = task.planner(geometric.PRM)
    planner.solve(base.plannerAlwaysTerminatingCondition())  # start and goal join the roadmap
    calls, size, search_seconds = 0, 64, 0.0

    def spent() -> bool:
        # called before each milestone and for each sample
        return progress.exhausted(calls // 2, ahead=search_seconds * planner.milestoneCount())

    def stop() -> bool:
        nonlocal calls
        calls += 1
        return planner.milestoneCount() >= size or spent()

    while True:
        planner.growRoadmapPtc(base.PlannerTerminationCondition(stop))
        began = progress.seconds
        points = shortest_in_roadmap(planner, task)
        search_seconds = (progress.seconds - began) / planner.milestoneCount()
        if points is not None:
            progress.record(length(points))
        if spent():
            return points
        size *= 2


def shortest_in_roadmap(planner: Any, task: Task) -> Array | None:
    """The shortest path (n, 2) [m] in a planner's roadmap; None if start and goal are separate."""
    data = base.PlannerData(task.space)
    planner.getPlannerData(data)
    number = data.numVertices()
    points = corners(data.getVertex(k).getState() for k in range(number))
    neighbours = [data.getEdges(k) for k in range(number)]
    rows = np.repeat(np.arange(number), [len(targets) for targets in neighbours])
    columns = np.fromiter(itertools.chain.from_iterable(neighbours), np.int64, len(rows))
    weights = np.linalg.norm(points[rows] - points[columns], axis=1)
    start, goal = data.getStartIndex(0), data.getGoalIndex(0)
    graph = csr_array((weights, (rows, columns)), shape=(number, number))
    distance, before = dijkstra(graph, indices=start, return_predecessors=True)
    if distance[goal] == math.inf:
        return None
    path = [goal]
    while path[-1] != start:
        path.append(before[path[-1]])
    return points[path[::-1]]


def solution(task: Task) -> Array | None:
    """Corners (n, 2) [m] of the route found; None if no route reaches the goal."""
    if not task.definition.hasExactSolution():  # an approximate one may exist
        return None
    return corners(task.definition.getSolutionPath().getStates())


def corners(states: Iterable[Any]) -> Array:
    """States of OMPL as points (n, 2) [m]."""
    return np.array([(state[0], state[1]) for state in states])


def simplified(task: Task, points: Array, barriers: Barriers) -> Array:
    """A route (n, 2) after OMPL's path simplifier, or unchanged if that is no valid improvement."""
    path = geometric.PathGeometric(task.space)
    state = task.space.allocState()
    for x, y in points.tolist():
        state[0], state[1] = x, y
        path.append(state)
    geometric.PathSimplifier(task.space).simplifyMax(path)
    shorter = corners(path.getStates())
    lines = np.concatenate([shorter[:-1], shorter[1:]], axis=1).tolist()
    clear = all(keeps_clear(x, y, end_x, end_y, *barriers) for x, y, end_x, end_y in lines)
    return shorter if clear and length(shorter) < length(points) else points


def length(points: Array) -> float:
    """Length of a polyline (n, 2) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


SEARCHES: dict[Algorithm, Callable[[Task, Progress], Array | None]]
SEARCHES = {"rrt": rrt, "rrt-star": rrt_star, "prm": prm, "bit-star": bit_star}


def answer(problem: Problem) -> Answer:
    """Solve a planning problem."""
    progress = Progress(problem)
    util.RNG.setSeed(problem.seed)
    task = Task.of(problem)
    points = SEARCHES[problem.algorithm](task, progress)
    if points is not None:
        progress.record(length(points))
        if problem.simplify:
            points = simplified(task, points, problem.barriers)
            progress.record(length(points))
    return Answer(points=points, progress=progress.lengths)


if __name__ == "__main__":
    util.noOutputHandler()
    # compile before anything is timed
    keeps_clear(0.0, 0.0, 0.0, 0.0, np.empty(0, DISC), *no_shapes())
    serve(answer)
