"""Recursive feasibility of `convex`: flights with and without a reserve (docs/convex.md).

A reserve is a certified chain from the vehicle to the goal. At first it is the whole flight that
`convex-path` plans. Each window is joined to it by one segment, certified too, from the window's
end to one of the reserve's knots; window, joint and the rest of the reserve are the next one. The
shorter of both is flown.

Run it from a checkout, with names of fields:

    .venv/bin/python benchmarks/convex_reserve.py standard/validation:0-99 town/validation:0-99
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import exact_length, gap
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import Field, Outcome, get_fields, is_feasible, transition
from planners.interface import State
from planners.optimization.certification import target_tolerance
from planners.receding_horizon.convex import Convex
from planners.rollout import ends_on_goal, remaining_plan, successor
from planners.whole_path.convex_fit import convex_fit
from planners.whole_path.exact import ShortestPathRouter

PLANNER = Convex()
COLUMNS = (
    "fields",
    "reserve",
    "arrived",
    "windows",
    "joined",
    "shorter",
    "plan flown",
    "gap, median",
)
HEADER = f"| {' | '.join(COLUMNS)} | 99 % | decision [ms] |\n|{' --- |' * (len(COLUMNS) + 2)}"


class Counts(NamedTuple):
    """What became of the windows of some decisions."""

    windows: int = 0
    """Decisions for which windows were solved."""
    joined: int = 0
    """Windows that were joined to the reserve or end on the goal."""
    shorter: int = 0
    """Those that were flown, since they shorten the reserve."""
    planned: int = 0
    """How often the rest of a plan was flown since no window was certified."""


class Flight(NamedTuple):
    """A flight and its decisions."""

    counts: Counts
    """Of all decisions."""
    arrived: bool
    gap: float
    seconds: list[float]
    """CPU time of each decision [s]."""


def joined(window: Array, reserve: Array, field: Field, left: int) -> Array | None:
    """The shortest certified chain of a window, a segment from its end, and a rest of a reserve.

    Args:
        window: certified segments (n, 4, 2).
        reserve: certified segments (m, 4, 2) that end on the goal.
        field: of both.
        left: number of segments that the limits allow.
    """
    ends = reserve[:, [1, 3]]  # knots and derivatives
    joints = np.empty((len(ends), 4, 2))
    joints[:, [0, 2]] = window[-1, [1, 3]]
    joints[:, [1, 3]] = ends
    after = np.append(np.cumsum(length(reserve[1:])[::-1])[::-1], 0.0)
    order = np.argsort(length(joints) + after, kind="stable")
    for k in order.tolist():
        if len(window) + len(reserve) - k > left:
            continue
        if is_feasible(joints[k], field, target_tolerance(field)):
            return np.concatenate([window, joints[k : k + 1], reserve[k + 1 :]])
    return None


def whole_flight(field: Field, vehicle: transition.State) -> Array | None:
    """The first reserve, if `convex-path` plans the flight."""
    route = ShortestPathRouter().route(field, vehicle, 0)
    return convex_fit(route.points, field, vehicle) if route else None


def decide(field: Field, state: State, *, with_reserve: bool) -> tuple[Array | None, Counts]:
    """The chain to fly from a state, and what became of its window."""
    rest = remaining_plan(field, state)
    plan = rest[0] if rest else None
    reserve = plan if ends_on_goal(field, state) else None
    if with_reserve and reserve is None:
        reserve = whole_flight(field, state.vehicle)
    if reserve is not None and not (with_reserve and len(reserve) >= PLANNER.segments):
        return reserve, Counts()
    near = State(state.vehicle, state.tail[: PLANNER.segments - 1], state.flown)
    found, _ = PLANNER.window(field, near)
    if found is None:
        return (plan if reserve is None else reserve), Counts(windows=1, planned=1)
    if reserve is None:
        return found.control, Counts(windows=1, joined=1, shorter=1)
    left = field.limits.segments - state.vehicle.segments
    longer = found.control if found.final else joined(found.control, reserve, field, left)
    if longer is None:
        return reserve, Counts(windows=1)
    if length(longer).sum() < length(reserve).sum():
        return longer, Counts(windows=1, joined=1, shorter=1)
    return reserve, Counts(windows=1, joined=1)


def flight(field: Field, *, with_reserve: bool) -> Flight:
    """Fly through a field."""
    distance_to_go(field)  # made once a field, before the first decision
    state, outcome = State(transition.initial_state(field)), Outcome.FLYING
    counts, flown, seconds = Counts(), 0.0, list[float]()
    while outcome is Outcome.FLYING:
        began = time.process_time()
        chain, more = decide(field, state, with_reserve=with_reserve)
        counts = Counts(*map(sum, zip(counts, more, strict=True)))
        if chain is None:
            break
        step = transition.fly_segment(field, state.vehicle, chain[0])
        seconds.append(time.process_time() - began)
        if not step.flown:
            break
        flown += float(step.inspection.length)
        state, outcome = successor(state, chain, step.state), step.outcome
    exact = exact_length(field)
    arrived = outcome is Outcome.GOAL_REACHED
    return Flight(counts, arrived, gap(flown, exact) if arrived and exact else np.inf, seconds)


def row(spec: str, with_reserve: bool) -> str:
    """A line of the table."""
    flights = [flight(field, with_reserve=with_reserve) for field in get_fields(spec)]
    windows, joints, shorter, planned = np.sum([one.counts for one in flights], axis=0)
    middle, wide = 100.0 * np.quantile([one.gap for one in flights], [0.5, 0.99], method="nearest")
    decision = 1e3 * np.median(np.concatenate([one.seconds for one in flights]))
    return (
        f"| {spec} | {'yes' if with_reserve else 'no'} | "
        f"{sum(one.arrived for one in flights)}/{len(flights)} | {windows:,} | {joints:,} | "
        f"{shorter:,} | {planned} | {middle:.3f} % | {wide:.3f} % | {decision:.2f} |"
    )


def main(specs: Sequence[str]) -> None:
    """Print the table."""
    flight(next(iter(get_fields("standard/train:0"))), with_reserve=True)  # compiles
    print(HEADER)
    for spec in specs:
        for with_reserve in (False, True):
            print(row(spec, with_reserve), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or ["standard/validation:0-99"])
