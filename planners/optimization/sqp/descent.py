"""The search from one initial guess, compiled; `elastic_sqp` describes the method."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ferguson_gym.curves.arc_length import DEPTH, NODES, segment_length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import (
    compiled,
    compiled_in_place,
    compiled_without_lock,
    unowned,
)
from ferguson_gym.shortest_paths.goal_search.search import GoalSearch
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.elastic_qp import Program, empty_program, reach, solve
from planners.optimization.sqp.expansion import Layout, expand
from planners.optimization.sqp.filter import REMEMBERED, accepts, remember
from planners.optimization.sqp.iterate import (
    Iterate,
    PlainLayout,
    agreement,
    as_layout,
    empty_iterate,
    predict,
)
from planners.optimization.sqp.lagrangian import lagrangian, warm_start_multipliers
from planners.optimization.sqp.modified_ldl import make_definite
from planners.optimization.sqp.objective_values import (
    ObjectiveValues,
    PlainObjective,
    as_objective,
    expand_objective,
)
from planners.optimization.sqp.trust_region import (
    SMALLEST,
    TrustRegion,
    after_accepted_step,
    after_failed_model,
    after_failed_restoration,
    after_rejected_step,
)

_FEASIBLE = 0.3
"""Sum of violations that counts as zero, as a fraction of the tolerance aimed for."""
_NEARLY_FEASIBLE = 1e-2
"""Violation [m] below which feasibility can be restored in a few steps."""
_RESTORED = 0.1
"""Radius [m] of the steps that restore the feasibility of an earlier iterate."""
CONVERGED, ABANDONED, DEADLINE, RESTORED, OUT_OF_ITERATIONS = 0, 1, 2, 3, 4
NO_STEP, NO_FEASIBLE_POINT, NO_IMPROVEMENT = 5, 6, 7
_ON = -1
_ROUNDS = 6
"""Maximum number of steps of a restoration."""
_START, _TRIAL, _PROJECTED, _CORRECTED, _KEPT, _DONE = 0, 1, 2, 3, 4, 5
"""Where the window is expanded next: at the guess, after a step of the search, after one of a
restoration, there again with certified lengths, at the best nearly feasible iterate, or nowhere."""
_STEP, _TO_KINK, _TO_END, _TO_KEPT = 0, 1, 2, 3
"""What the next quadratic program is for: a step of the search, or the restoration of feasibility
with the end on the kink, at the end of the search, or near the best nearly feasible iterate."""


class Options(NamedTuple):
    """The options of `ElasticSqp`."""

    precision: float
    iterations: int
    patience: float
    radius: float
    max_radius: float
    floor: float
    max_violation: float


class Task(NamedTuple):
    """A window in numbers; beside them the layout and the objective."""

    low: Array
    """(m,) bounds of the unknowns."""
    high: Array
    """(m,)."""
    scale: Array
    """(m,) 1 for points, 3 for derivatives."""
    kink: Array
    """(2,) where the objective has a kink, or (0,)."""
    tolerance: float
    """That is aimed for [m]."""
    cornered: bool
    """Whether some obstacles are no discs."""


class _Search(NamedTuple):
    """What a search knows and where it stores."""

    layout: Layout
    objective: ObjectiveValues
    task: Task
    program: Program
    p: Array
    """(m,) the latest step."""
    counts: Array
    """(2,) steps and evaluations, as real numbers: they are returned with others."""


@compiled_in_place
def _visit(
    now: _Search, goal_search: GoalSearch | None, point: Iterate, x: Array, radius: float
) -> GoalSearch | None:
    """Expand the window at unknowns x for steps within a radius."""
    for i in range(len(x)):
        point.x[i] = x[i]
    here = point.expansion
    contacts, violation, length, bent = expand(point.x, now.layout, reach(radius), here)
    end = here.control[len(here.control) - 1, 1]
    after, value = expand_objective(
        now.objective, goal_search, length, end, point.slope, point.curvature
    )
    point.values[0], point.values[1] = value + bent, violation
    point.contacts[0] = contacts
    now.counts[1] += 1.0
    return after


@compiled_in_place
def _differentiate(now: _Search, point: Iterate) -> None:
    """Fill the gradient of the objective and the Hessian of the Lagrangian at a point."""
    lagrangian(
        now.layout,
        point.expansion,
        point.contacts[0],
        point.slope,
        point.curvature,
        point.tension,
        point.multiplier,
        BENDING,
        point.gradient,
        point.hessian,
    )


@compiled_in_place
def _solve(
    now: _Search,
    point: Iterate,
    gradient: Array,
    hessian: Array,
    radius: float,
    low: Array,
    high: Array,
) -> bool:
    """Fill the step of the quadratic program at a point; False if it has no solution."""
    return solve(
        point.expansion,
        point.contacts[0],
        point.x,
        low,
        high,
        now.task.scale,
        radius,
        now.layout,
        gradient,
        hessian,
        point.tension,
        point.multiplier,
        now.program,
        now.p,
    )


@compiled_in_place
def _adopt_multipliers(now: _Search, before: Iterate, point: Iterate) -> None:
    """Transfer the multipliers of the latest step from one point to the next."""
    old, new, contacts = before.expansion, point.expansion, point.contacts[0]
    across = now.task.cornered
    warm_start_multipliers(old, now.program, new, contacts, across, point.tension, point.multiplier)


@compiled
def _length_errors(control: Array, length: Array, off: Array) -> float:
    """Fill the certified lengths less some lengths (n,) [m]; return the largest in size."""
    stack, widths, speed2 = np.empty((DEPTH, 3, 2)), np.empty(DEPTH), np.empty(NODES)
    worst = 0.0
    for k in range(len(length)):
        off[k] = segment_length(control[k], stack, widths, speed2, (0, 1)) - length[k]
        worst = max(worst, abs(off[k]))
    return worst


@compiled
def _from_kink(kink: Array, control: Array) -> float:
    """Distance of the chain's end from the objective's kink [m]; infinite without one."""
    if len(kink) == 0:
        return float(np.inf)
    n = len(control) - 1
    across, along = control[n, 1, 0] - kink[0], control[n, 1, 1] - kink[1]
    return float(np.sqrt(across**2 + along**2))


@compiled
def _fill_box(task: Task, place: Integers, on_kink: bool, low: Array, high: Array) -> None:
    """Fill the bounds of the unknowns, which can hold the chain's end on the kink."""
    for i in range(len(low)):
        low[i], high[i] = task.low[i], task.high[i]
    if on_kink:
        for d in range(2):
            i = place[len(place) - 1, 2 + d]
            low[i] = high[i] = task.kink[d]


@compiled
def _stops(here: Array, gain: float, precision: float, patience: float, bound: float) -> int:
    """Why a nearly feasible search should end, given an iterate's values, or _ON."""
    little = gain < precision * max(1.0, abs(here[0]))
    abandoned = here[0] - patience * gain > bound
    if not (little or abandoned) or not here[1] < _NEARLY_FEASIBLE:
        return _ON
    return CONVERGED if little else ABANDONED


@compiled_without_lock
def descend(
    plain_layout: PlainLayout,
    plain_objective: PlainObjective,
    plain_task: tuple[Any, ...],
    goal_search: GoalSearch | None,
    x: Array,
    plain_options: tuple[Any, ...],
    steps: int,
    bound: float,
    room: int,
) -> tuple[GoalSearch | None, int, float, int, int]:
    """Search for a local minimum from unknowns x (m,), which are moved there.

    The layout's corrections of lengths are moved with them.

    Args:
        plain_layout: the window's chain and limits.
        plain_objective: its objective.
        plain_task: its other numbers.
        goal_search: from which the cost-to-go comes where there is no tangent graph.
        x: (m,), the guess and the result.
        plain_options: of the search.
        steps: number of steps that earlier searches have used.
        bound: stop early if the objective cannot fall below this [m].
        room: number of contacts for which there is memory.

    All of it is one function, with one place for each of its long parts: the compiler optimises
    what a function calls again in each of its callers.

    Returns:
        The search from the goal, continued; the reason for stopping; the objective; the numbers of
        steps, earlier ones included, and of evaluations.
    """
    layout, objective = as_layout(plain_layout), as_objective(plain_objective)
    task, options = Task(*plain_task), Options(*plain_options)
    n, m = len(layout.base), len(x)
    memory = empty_iterate(n, m, room), empty_iterate(n, m, room)
    program, counts, p = empty_program(n, m, room), np.zeros(2), np.empty(m)
    counts[0] = steps
    now = _Search(layout, objective, task, program, p, counts)
    here, there = unowned(memory)  # without counting references where they change places
    region = TrustRegion(options.radius, options.floor, options.precision)
    pairs, remembered, model = np.empty((REMEMBERED, 2)), 0, np.empty((m, m))
    metric, no_gradient, off = np.zeros((m, m)), np.zeros(m), np.empty(n)
    low, high, target, kept, last = x.copy(), x.copy(), x.copy(), x.copy(), x.copy()
    for i in range(m):
        metric[i, i] = 1.0 / task.scale[i] ** 2
    _fill_box(task, layout.place, False, low, high)
    allowed = _FEASIBLE * task.tolerance
    nearest = best = violation = np.inf
    most = decrease = size = last_value = radius = 0.0
    visit, aim, found, reason, rounds, wide = _START, _STEP, _ON, _ON, 0, region.radius
    after = goal_search
    while visit != _DONE:
        # the window is expanded at the next point
        point = here if visit in (_START, _KEPT) else there
        after = _visit(now, after, point, target, wide)
        moved, failed = visit == _START, False
        if visit != _TRIAL:
            for row in range(point.contacts[0]):
                point.multiplier[row] = 0.0
        if visit == _START:
            for k in range(n):
                here.tension[k] = 0.0
            most = max(options.max_violation, here.values[1])
        elif visit == _TRIAL:
            ratio = -1.0
            if accepts(pairs, remembered, most, there.values[0], there.values[1]):
                ratio = agreement(here.values, there.values, decrease)
            if ratio > 0.0:
                _adopt_multipliers(now, here, there)
                here, there, moved = there, here, True
                region = after_accepted_step(region, ratio, size, options.max_radius)
            else:
                region = after_rejected_step(region, size)
                reason = NO_IMPROVEMENT if region.radius < SMALLEST else _ON
        elif visit == _PROJECTED and there.values[1] < allowed:
            if _length_errors(there.expansion.control, there.expansion.length, off) < allowed:
                here, reason = there, found
                break
            for k in range(n):
                layout.correction[k] += off[k]
            visit = _CORRECTED
            continue
        if visit in (_PROJECTED, _CORRECTED):
            rounds += 1
            failed = rounds == _ROUNDS or there.values[1] > 0.5 * violation
            violation = there.values[1]
        if moved:
            _differentiate(now, here)
        # quadratic programs are solved until one leads to a point
        while True:
            if aim == _STEP:
                if task.cornered and here.values[1] < _NEARLY_FEASIBLE and here.values[0] < best:
                    best = here.values[0]
                    for i in range(m):
                        kept[i] = here.x[i]
                if reason == _ON and counts[0] >= options.iterations:
                    reason = OUT_OF_ITERATIONS
                if reason != _ON:
                    visit = _KEPT if best < np.inf and here.values[1] >= allowed else _DONE
                    break
                counts[0] += 1.0
                distance = _from_kink(task.kink, here.expansion.control)
                if distance < min(region.radius, 0.5 * nearest):
                    nearest, radius = distance, region.radius
                    aim, found, rounds = _TO_KINK, CONVERGED, 0
                    _fill_box(task, layout.place, True, low, high)
            if aim == _STEP:
                make_definite(here.hessian, region.floor, model)
            elif rounds == 0:
                violation = np.inf
                for k in range(n):
                    there.tension[k] = here.tension[k]
            point = here if rounds == 0 or aim == _STEP else there
            gradient = here.gradient if aim == _STEP else no_gradient
            hessian = model if aim == _STEP else metric
            within = region.radius if aim == _STEP else radius
            solved = not failed and _solve(now, point, gradient, hessian, within, low, high)
            if aim != _STEP:
                visit = _PROJECTED
                if solved:
                    break
                if aim == _TO_KEPT:
                    visit, here.values[0] = _DONE, last_value
                    for i in range(m):
                        here.x[i] = last[i]
                    break
                # no feasible point is near: the search goes on
                if aim == _TO_KINK:
                    counts[0] -= 1.0
                else:
                    region = after_failed_restoration(region)
                    reason = NO_FEASIBLE_POINT if region.radius < SMALLEST else _ON
                aim, failed = _STEP, False
                _fill_box(task, layout.place, False, low, high)
                continue
            if not solved:
                region = after_failed_model(region)
                if region.radius < SMALLEST:
                    visit, reason = _DONE, NO_STEP
                    break
                continue
            decrease, gain, size = predict(now.p, here.gradient, model, task.scale, program)
            found = _stops(here.values, gain, region.precision, options.patience, bound)
            if found == _ON:
                visit = _TRIAL
                break
            aim, rounds, radius = _TO_END, 0, max(region.radius, 0.1)
        if visit == _KEPT:
            last_value, wide = here.values[0], _RESTORED
            aim, found, rounds, radius = _TO_KEPT, RESTORED, 0, _RESTORED
            for i in range(m):
                last[i], target[i] = here.x[i], kept[i]
        elif visit != _DONE:
            wide = radius if visit == _PROJECTED else max(region.radius, size)
            for i in range(m):
                target[i] = point.x[i] + p[i]
            if visit == _TRIAL:
                remembered = remember(pairs, remembered, here.values[0], here.values[1])
    for i in range(m):
        x[i] = here.x[i]
    value = here.values[0]
    memory[0].values[0] = value  # a last use, which keeps the memory alive until here
    return after, reason, value, int(counts[0]), int(counts[1])
