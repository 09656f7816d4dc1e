"""Exact any-angle paths and flights in MovingAI maps of one's own, against a second implementation.

Run it from a checkout: `.venv/bin/python benchmarks/grid_maps.py FOLDER [--pairs 10]
[--rectangles 2500] [--fly guided ...]`. Of each map in FOLDER with a scenario `.map.scen` beside
it, and with at most so many rectangles, pairs at even steps through the scenario are solved twice:
by `DistanceToGoal`, and by a search over the corners of cells that knows neither rectangles nor
margins, since its lines of sight are decided in whole numbers. Of these pairs, the longest of at
most 200 cells is flown by each planner, with segments for twice its exact length where there are
fewer by default. Times are processor times of one thread, without compilation.
"""

from __future__ import annotations

import argparse
import heapq
import math
import time
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

import planners
from ferguson_gym.curves import length
from ferguson_gym.importers import read_map
from ferguson_gym.importers.grid_rectangles import overlapping
from ferguson_gym.importers.movingai import CELL, read_cells, read_pairs
from ferguson_gym.shortest_paths import DistanceToGoal, gap
from ferguson_gym.world.field import Field
from planners.interface import initial_state

Cells = NDArray[np.bool_]
Points = NDArray[np.int64]
FLOWN = 200.0
"""Length of the longest pairs that are flown [cells]."""


def corners_of(blocked: Cells) -> tuple[Points, Points]:
    """Corners (n, 2) of cells at which paths can turn, as column and row, and their signs (n,).

    There one of the four cells is blocked, or two that touch only there; the sign is 1 where these
    lie to the lower right or the upper left. Cells outside the map count as blocked.
    """
    padded = np.pad(blocked, 1, constant_values=True)
    falling = padded[:-1, :-1].astype(np.int64) + padded[1:, 1:]
    rising = padded[:-1, 1:].astype(np.int64) + padded[1:, :-1]
    row, column = np.nonzero((falling > 0) ^ (rising > 0))
    return np.stack([column, row], axis=1), np.where(falling[row, column] > 0, 1, -1)


@numba.njit(cache=False)
def is_blocked(blocked: Cells, column: int, row: int) -> bool:
    """Whether a cell is blocked or outside the map."""
    inside = 0 <= row < blocked.shape[0] and 0 <= column < blocked.shape[1]
    return not inside or blocked[row, column]


@numba.njit(cache=False)
def sees(blocked: Cells, x: int, y: int, u: int, v: int) -> bool:
    """Whether a line passes no blocked cell's inside, and no side between two blocked cells.

    Coordinates count half cells, so that centres and corners of cells are whole numbers.
    """
    if x > u:
        x, y, u, v = u, v, x, y
    dx, dy = u - x, v - y
    if dx == 0 or dy == 0:
        first, last = (min(y, v), max(y, v)) if dx == 0 else (x, u)
        across = x if dx == 0 else y
        for place in range(first // 2, -((-last) // 2)):
            free = False
            for side in range((across - 1) // 2, across // 2 + 1):
                column, row = (side, place) if dx == 0 else (place, side)
                free = free or not is_blocked(blocked, column, row)
            if not free:
                return False
        return True
    for column in range(x // 2, -((-u) // 2)):
        # heights, in units of 1 / dx, at which the line enters and leaves the column
        left, right = max(2 * column, x), min(2 * column + 2, u)
        enter, leave = y * dx + dy * (left - x), y * dx + dy * (right - x)
        if enter > leave:
            enter, leave = leave, enter
        for row in range(enter // (2 * dx), -((-leave) // (2 * dx))):
            if is_blocked(blocked, column, row):
                return False
    return True


@numba.njit(cache=False)
def any_angle_length(
    blocked: Cells, corners: Points, signs: Points, start: Points, goal: Points
) -> float:
    """Length of the shortest path [cells] by A* over all corners, infinite without one.

    Start, goal and corners are in half cells. A line that ends at a corner must pass it by, since
    no shortest path turns elsewhere.
    """
    number = len(corners)
    reached = np.full(number, np.inf)
    closed = np.zeros(number, np.bool_)
    best = np.inf
    heap = [(math.hypot(goal[0] - start[0], goal[1] - start[1]), -1)]
    while len(heap) > 0:
        bound, here = heapq.heappop(heap)
        if bound >= best:
            break
        if here >= 0 and closed[here]:
            continue
        x, y = (start[0], start[1]) if here < 0 else (corners[here, 0], corners[here, 1])
        length = 0.0 if here < 0 else reached[here]
        if here >= 0:
            closed[here] = True
        straight = math.hypot(goal[0] - x, goal[1] - y)
        if length + straight < best and sees(blocked, x, y, goal[0], goal[1]):
            best = length + straight
        for other in range(number):
            dx, dy = corners[other, 0] - x, corners[other, 1] - y
            if closed[other] or signs[other] * dx * dy > 0:
                continue
            if here >= 0 and signs[here] * dx * dy > 0:
                continue
            total = length + math.hypot(dx, dy)
            ahead = math.hypot(goal[0] - corners[other, 0], goal[1] - corners[other, 1])
            if total >= reached[other] or total + ahead >= best:
                continue
            if sees(blocked, x, y, corners[other, 0], corners[other, 1]):
                reached[other] = total
                heapq.heappush(heap, (total + ahead, other))
    return 0.5 * best


def measure(path: Path, number: int, names: list[str]) -> str:
    """A row of the table: exact lengths and their times, and flights of one pair."""
    blocked = read_cells(path)
    pairs = read_pairs(Path(f"{path}.scen"), path, blocked, None)
    # the scenarios are sorted by length
    chosen = np.unique(np.linspace(0, len(pairs) - 1, number).round().astype(int)).tolist()
    corners, signs = corners_of(blocked)
    builds, queries, others, errors = [], [], [], [0.0]
    lengths: list[float] = []
    for k in chosen:
        (field,) = read_map(path, pairs=range(k, k + 1))
        began = time.process_time()
        togo = DistanceToGoal(field)
        built = time.process_time()
        shortest = togo.path(field.start)
        found = time.process_time()
        lengths.append(np.inf if shortest is None else shortest.length / CELL)
        start, goal = (2 * np.array(place) + 1 for place in pairs[k][1:])
        other = any_angle_length(blocked, 2 * corners, signs, start, goal)
        others.append(time.process_time() - found)
        builds.append(built - began)
        queries.append(found - built)
        if lengths[-1] != other:
            errors.append(abs(lengths[-1] / other - 1.0))
    best = max(range(len(chosen)), key=lambda k: (lengths[k] <= FLOWN) * lengths[k])
    (field,) = read_map(path, pairs=range(chosen[best], chosen[best] + 1))
    flights = [fly(field, name, CELL * lengths[best]) for name in names]
    build, query, second = (1e3 * float(np.median(times)) for times in (builds, queries, others))
    return (
        f"{path.stem} | {blocked.shape[1]} x {blocked.shape[0]} | {len(field.obstacles)} | "
        f"{max(errors):.0e} | {build:.0f} ms | {query:.2f} ms | {1e3 * max(queries):.2f} ms | "
        f"{second:.1f} ms | {lengths[best]:.1f} | {' | '.join(flights)}"
    )


def fly(field: Field, name: str, exact: float) -> str:
    """A planner's gap, segments and time for a field whose exact length [m] is known."""
    enough = math.ceil(2.0 * exact / field.limits.longest)
    field = field.with_limits(segments=max(field.limits.segments, enough))
    planner = planners.make(name)
    began = time.process_time()
    plan = planner.plan(field, initial_state(field), 0)
    seconds = time.process_time() - began
    if not plan.success:
        return f"{plan.status.label} after {len(plan.control)} ({seconds:.1f} s)"
    excess = gap(float(length(plan.control).sum()), exact)
    return f"{100 * excess:.3f} %, {len(plan.control)}, {seconds:.1f} s"


def main() -> None:
    """Print a table, a row for each map."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--rectangles", type=int, default=2500)
    parser.add_argument("--fly", nargs="*", default=["guided", "shortest", "convex"])
    options = parser.parse_args()
    maps = sorted(path for path in options.folder.rglob("*.map") if Path(f"{path}.scen").exists())
    if not maps:
        parser.error(f"{options.folder} has no MAP.map with MAP.map.scen beside it")
    sizes = {path: len(overlapping(read_cells(path))[0]) for path in maps}
    smallest = sorted(maps, key=lambda path: sizes[path])
    measure(smallest[0], 2, options.fly)  # compile
    print(
        "map | cells | rectangles | greatest difference | build | query | slowest query | second "
        f"implementation | flown [cells] | {' | '.join(options.fly)}"
    )
    for path in smallest:
        if sizes[path] <= options.rectangles:
            print(measure(path, options.pairs, options.fly), flush=True)
        else:
            print(f"{path.stem} | {sizes[path]} rectangles, left out", flush=True)


if __name__ == "__main__":
    main()
