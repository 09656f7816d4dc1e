"""The process in which OMPL plans, started by `planners.whole_path.subprocess_worker`.

Everything of OMPL is made anew for each problem, after the seed is set: then it draws the same
numbers whatever was planned before. OMPL asks Python whether a line is clear, a hundred thousand
times a second, and before each iteration whether to stop.

Reference:
    LaValle & Kuffner (2001), Randomized kinodynamic planning, IJRR 20(5): RRT. Karaman & Frazzoli
    (2011), Sampling-based algorithms for optimal motion planning, IJRR 30(7): RRT*. Kavraki,
    Svestka, Latombe & Overmars (1996), Probabilistic roadmaps for path planning in
    high-dimensional configuration spaces, IEEE Transactions on Robotics and Automation 12(4): PRM.
    Gammell, Barfoot & Srinivasa (2020), Batch Informed Trees, IJRR 39(5): BIT*.
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
from ferguson_gym.shortest_paths.tangents import DISC, Records
from planners.interface import Iterations
from planners.whole_path.line_of_sight import keeps_clear
from planners.whole_path.ompl import Algorithm, Answer, Problem
from planners.whole_path.subprocess_worker import serve


class Lines(base.MotionValidator):  # type: ignore[misc]
    """Straight lines are valid where they keep clear of discs, exactly."""

    def __init__(self, space: Any, discs: Records) -> None:
        super().__init__(space)
        self._discs = discs

    def checkMotion(self, start: Any, end: Any) -> bool:  # noqa: N802  (OMPL's name)
        """Whether a line is clear; it is inside the bounds where its ends are."""
        return keeps_clear(start[0], start[1], end[0], end[1], self._discs)


class Watch:
    """What is left of a problem's budget, and the lengths reached so far."""

    def __init__(self, problem: Problem) -> None:
        self._began = time.perf_counter()
        self._budget = problem.budget
        self.progress: list[tuple[float, float]] = []

    @property
    def seconds(self) -> float:
        """Since planning began."""
        return time.perf_counter() - self._began

    def spent(self, iterations: int, ahead: float = 0.0) -> bool:
        """Whether the budget is spent after iterations, and with work of some seconds ahead."""
        if isinstance(self._budget, Iterations):
            return iterations >= self._budget.count
        return self.seconds + ahead >= self._budget.seconds

    def note(self, length: float) -> None:
        """Keep a length [m] if it is the least so far."""
        if length < (self.progress[-1][1] if self.progress else math.inf):
            self.progress.append((self.seconds, length))


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A problem as OMPL holds it."""

    space: Any
    """`SpaceInformation`."""
    definition: Any
    """`ProblemDefinition`."""

    @classmethod
    def of(cls, problem: Problem) -> Task:
        """Set it up."""
        plane = base.RealVectorStateSpace(2)
        box = base.RealVectorBounds(2)
        box.low, box.high = problem.bounds.tolist()
        plane.setBounds(box)
        space = base.SpaceInformation(plane)
        discs = problem.discs

        def is_free(state: Any) -> bool:
            x, y = state[0], state[1]
            return keeps_clear(x, y, x, y, discs)

        space.setStateValidityChecker(is_free)
        space.setMotionValidator(Lines(space, discs))
        space.setup()
        definition = base.ProblemDefinition(space)
        ends = [space.allocState(), space.allocState()]
        for end, point in zip(ends, (problem.start, problem.goal), strict=True):
            end[0], end[1] = point.tolist()
        definition.setStartAndGoalStates(*ends)
        definition.setOptimizationObjective(base.PathLengthOptimizationObjective(space))
        return cls(space, definition)

    def ready(self, algorithm: Any) -> Any:
        """One of OMPL's planners, to be started."""
        planner = algorithm(self.space)
        planner.setProblemDefinition(self.definition)
        planner.setup()
        return planner


def rrt(task: Task, watch: Watch) -> Array | None:
    """A tree from the start that grows until it reaches the goal."""
    iterations = itertools.count()
    planner = task.ready(geometric.RRT)
    planner.solve(base.PlannerTerminationCondition(lambda: watch.spent(next(iterations))))
    return solution(task)


def rrt_star(task: Task, watch: Watch) -> Array | None:
    """A tree that is rewired as it grows."""
    iterations = itertools.count()
    planner = task.ready(geometric.RRTstar)

    def stop() -> bool:
        watch.note(planner.bestCost().value())
        return watch.spent(next(iterations))

    planner.solve(base.PlannerTerminationCondition(stop))
    return solution(task)


def bit_star(task: Task, watch: Watch) -> Array | None:
    """Batches of samples, searched in the order of what a path through them can be worth."""
    planner = task.ready(geometric.BITstar)

    def stop() -> bool:
        watch.note(planner.bestCost().value())
        return watch.spent(planner.numBatches() - 1)  # the last one is not finished

    planner.solve(base.PlannerTerminationCondition(stop))
    return solution(task)


def prm(task: Task, watch: Watch) -> Array | None:
    """A roadmap, searched each time it has doubled.

    OMPL grows it. Its own search runs in a thread beside the growing, by the clock: then the same
    seed does not give the same roadmap, and Python cannot be asked from two threads.
    """
    planner = task.ready(geometric.PRM)
    planner.solve(base.plannerAlwaysTerminatingCondition())  # start and goal join the roadmap
    asked, size, pace = 0, 64, 0.0

    def spent() -> bool:
        # asked before each milestone, and each time one is looked for
        return watch.spent(asked // 2, ahead=pace * planner.milestoneCount())

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return planner.milestoneCount() >= size or spent()

    while True:
        planner.growRoadmapPtc(base.PlannerTerminationCondition(stop))
        began = watch.seconds
        points = shortest_in_roadmap(planner, task)
        pace = (watch.seconds - began) / planner.milestoneCount()  # of a search
        if points is not None:
            watch.note(length(points))
        if spent():
            return points
        size *= 2


def shortest_in_roadmap(planner: Any, task: Task) -> Array | None:
    """The shortest way from start to goal in a planner's roadmap (n, 2) [m]; None without one."""
    data = base.PlannerData(task.space)
    planner.getPlannerData(data)
    number = data.numVertices()
    points = corners(data.getVertex(k).getState() for k in range(number))
    ahead = [data.getEdges(k) for k in range(number)]
    rows = np.repeat(np.arange(number), [len(every) for every in ahead])
    columns = np.fromiter(itertools.chain.from_iterable(ahead), np.int64, len(rows))
    weights = np.linalg.norm(points[rows] - points[columns], axis=1)
    start, goal = data.getStartIndex(0), data.getGoalIndex(0)
    graph = csr_array((weights, (rows, columns)), shape=(number, number))
    distance, before = dijkstra(graph, indices=start, return_predecessors=True)
    if distance[goal] == math.inf:
        return None
    way = [goal]
    while way[-1] != start:
        way.append(before[way[-1]])
    return points[way[::-1]]


def solution(task: Task) -> Array | None:
    """The corners (n, 2) [m] of a route that reaches the goal; None without one."""
    if not task.definition.hasExactSolution():  # there may be one that ends near it
        return None
    path = task.definition.getSolutionPath()
    return corners(path.getStates())


def corners(states: Iterable[Any]) -> Array:
    """States of the plane as an array (n, 2) [m]."""
    return np.array([(state[0], state[1]) for state in states])


def simplified(task: Task, points: Array, discs: Records) -> Array:
    """A route (n, 2) after OMPL's path simplifier; as it was where that spoils it."""
    path = geometric.PathGeometric(task.space)
    state = task.space.allocState()
    for x, y in points.tolist():
        state[0], state[1] = x, y
        path.append(state)
    geometric.PathSimplifier(task.space).simplifyMax(path)
    shorter = corners(path.getStates())
    lines = np.concatenate([shorter[:-1], shorter[1:]], axis=1).tolist()
    clear = all(keeps_clear(x, y, end_x, end_y, discs) for x, y, end_x, end_y in lines)
    if clear and length(shorter) < length(points):
        return shorter
    return points


def length(points: Array) -> float:
    """Of a polyline (n, 2) [m]."""
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


SEARCHES: dict[Algorithm, Callable[[Task, Watch], Array | None]] = {
    "rrt": rrt,
    "rrt-star": rrt_star,
    "prm": prm,
    "bit-star": bit_star,
}


def answer(problem: Problem) -> Answer:
    """Plan."""
    watch = Watch(problem)
    util.RNG.setSeed(problem.seed)
    task = Task.of(problem)
    points = SEARCHES[problem.algorithm](task, watch)
    if points is not None:
        watch.note(length(points))
        if problem.simplify:
            points = simplified(task, points, problem.discs)
            watch.note(length(points))
    return Answer(points=points, progress=watch.progress)


if __name__ == "__main__":
    util.noOutputHandler()
    keeps_clear(0.0, 0.0, 0.0, 0.0, np.empty(0, DISC))  # compiled before anything is timed
    serve(answer)
