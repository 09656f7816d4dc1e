"""The search from one initial guess, compiled; `elastic_sqp` describes the method."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from ferguson_gym.curves.arc_length import DEPTH, NODES, segment_length
from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_without_lock
from ferguson_gym.shortest_paths.goal_search.search import GoalSearch
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.elastic_qp import Program, empty_program, reach, solve
from planners.optimization.sqp.expansion import Layout, expand
from planners.optimization.sqp.filter import REMEMBERED, accepts, remember
from planners.optimization.sqp.iterate import Iterate, agreement, empty_iterate, predict
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
_ON, _FAILED = -1, -2


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


PlainLayout: TypeAlias = tuple[Any, ...]
"""`Layout` as plain tuples, which are passed to compiled functions in less time."""


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


@compiled
def _visit(
    now: _Search, goal_search: GoalSearch | None, point: Iterate, x: Array, radius: float
) -> GoalSearch | None:
    """Expand the window at unknowns x for steps within a radius."""
    point.x[:] = x
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


@compiled
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


@compiled
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


@compiled
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
def _restore_feasibility(
    now: _Search,
    goal_search: GoalSearch | None,
    here: Iterate,
    there: Iterate,
    radius: float,
    low: Array,
    high: Array,
) -> tuple[GoalSearch | None, bool]:
    """Project a point onto the linearised constraints until `there` satisfies the true ones."""
    scale, allowed = now.task.scale, _FEASIBLE * now.task.tolerance
    m = len(scale)
    metric, no_gradient, off = np.zeros((m, m)), np.zeros(m), np.empty(len(here.tension))
    for i in range(m):
        metric[i, i] = 1.0 / scale[i] ** 2
    after, point, violation = goal_search, here, np.inf
    there.tension[:] = here.tension
    for _ in range(6):
        if not _solve(now, point, no_gradient, metric, radius, low, high):
            return after, False
        before = point.x + now.p
        after = _visit(now, after, there, before, radius)
        there.multiplier[: there.contacts[0]] = 0.0
        if there.values[1] < allowed:
            if _length_errors(there.expansion.control, there.expansion.length, off) < allowed:
                return after, True
            now.layout.correction[:] += off
            after = _visit(now, after, there, before, radius)
            there.multiplier[: there.contacts[0]] = 0.0
        if there.values[1] > 0.5 * violation:
            return after, False
        point, violation = there, there.values[1]
    return after, False


@compiled
def _fall_back(
    now: _Search,
    goal_search: GoalSearch | None,
    here: Iterate,
    there: Iterate,
    kept: Array,
    reason: int,
) -> tuple[GoalSearch | None, Iterate, int]:
    """The feasible point near the best nearly feasible iterate, or the last iterate."""
    if len(kept) == 0 or here.values[1] < _FEASIBLE * now.task.tolerance:
        return goal_search, here, reason
    last = here.x.copy()
    after = _visit(now, goal_search, here, kept, _RESTORED)
    here.multiplier[: here.contacts[0]] = 0.0
    low, high = now.task.low, now.task.high
    after, found = _restore_feasibility(now, after, here, there, _RESTORED, low, high)
    if found:
        return after, there, RESTORED
    after = _visit(now, after, here, last, _RESTORED)
    return after, here, reason


@compiled
def _from_kink(now: _Search, point: Iterate) -> float:
    """Distance of the chain's end from the objective's kink [m]; infinite without one."""
    kink, control = now.task.kink, point.expansion.control
    if len(kink) == 0:
        return float(np.inf)
    end = control[len(control) - 1, 1]
    return float(np.sqrt((end[0] - kink[0]) ** 2 + (end[1] - kink[1]) ** 2))


@compiled
def _end_on_kink(
    now: _Search, goal_search: GoalSearch | None, here: Iterate, there: Iterate, radius: float
) -> tuple[GoalSearch | None, bool]:
    """Restore feasibility with the chain's end on the kink."""
    low, high = now.task.low.copy(), now.task.high.copy()
    places = now.layout.place[len(now.layout.place) - 1]
    for d in range(2):
        low[places[2 + d]] = high[places[2 + d]] = now.task.kink[d]
    return _restore_feasibility(now, goal_search, here, there, radius, low, high)


@compiled
def _stops(here: Iterate, gain: float, precision: float, patience: float, bound: float) -> int:
    """Why a nearly feasible search should end, or _ON."""
    little = gain < precision * max(1.0, abs(here.values[0]))
    abandoned = here.values[0] - patience * gain > bound
    if not (little or abandoned) or not here.values[1] < _NEARLY_FEASIBLE:
        return _ON
    return CONVERGED if little else ABANDONED


@compiled
def _iterate(
    now: _Search,
    goal_search: GoalSearch | None,
    start: Array,
    options: Options,
    bound: float,
    here: Iterate,
    there: Iterate,
) -> tuple[GoalSearch | None, Iterate, int]:
    """Search from unknowns (m,); the last iterate, and the reason for stopping."""
    low, high, scale, cornered = now.task.low, now.task.high, now.task.scale, now.task.cornered
    region = TrustRegion(options.radius, options.floor, options.precision)
    pairs, remembered, model = np.empty((REMEMBERED, 2)), 0, np.empty(here.hessian.shape)
    after = _visit(now, goal_search, here, start, region.radius)
    here.tension[:] = 0.0
    here.multiplier[: here.contacts[0]] = 0.0
    _differentiate(now, here)
    most = max(options.max_violation, here.values[1])
    nearest, kept, best = np.inf, np.empty(0), np.inf
    while True:
        if cornered and here.values[1] < _NEARLY_FEASIBLE and here.values[0] < best:
            kept, best = here.x.copy(), here.values[0]
        if now.counts[0] >= options.iterations:
            return _fall_back(now, after, here, there, kept, OUT_OF_ITERATIONS)
        now.counts[0] += 1.0
        distance = _from_kink(now, here)
        if distance < min(region.radius, 0.5 * nearest):
            nearest = distance
            after, found = _end_on_kink(now, after, here, there, region.radius)
            if found:
                return after, there, CONVERGED
        make_definite(here.hessian, region.floor, model)
        if not _solve(now, here, here.gradient, model, region.radius, low, high):
            region = after_failed_model(region)
            if region.radius < SMALLEST:
                return after, here, NO_STEP
            continue
        decrease, gain, size = predict(now.p, here.gradient, model, scale, now.program)
        reason = _stops(here, gain, region.precision, options.patience, bound)
        if reason != _ON:
            radius = max(region.radius, 0.1)
            after, found = _restore_feasibility(now, after, here, there, radius, low, high)
            if found:
                return after, there, reason
            region = after_failed_restoration(region)
            if region.radius < SMALLEST:
                return _fall_back(now, after, here, there, kept, NO_FEASIBLE_POINT)
            continue
        remembered = remember(pairs, remembered, here.values[0], here.values[1])
        after = _visit(now, after, there, here.x + now.p, max(region.radius, size))
        ratio = -1.0
        if accepts(pairs, remembered, most, there.values[0], there.values[1]):
            ratio = agreement(here.values, there.values, decrease)
        if ratio <= 0.0:
            region = after_rejected_step(region, size)
            if region.radius < SMALLEST:
                return _fall_back(now, after, here, there, kept, NO_IMPROVEMENT)
            continue
        _adopt_multipliers(now, here, there)
        _differentiate(now, there)
        here, there = there, here
        region = after_accepted_step(region, ratio, size, options.max_radius)


@compiled
def as_layout(plain: PlainLayout) -> Layout:
    """The layout that plain tuples hold."""
    base, place, bounds, centers, radii, cores, slowest, limits = plain[:8]
    bending, correction, pinned, turn_radius = plain[8:]
    return Layout(
        base,
        place,
        bounds,
        centers,
        radii,
        Cores(*cores),
        slowest,
        limits,
        bending,
        correction,
        pinned,
        turn_radius,
    )


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

    Returns:
        The search from the goal, continued; the reason for stopping; the objective; the numbers of
        steps, earlier ones included, and of evaluations.
    """
    layout, objective = as_layout(plain_layout), as_objective(plain_objective)
    task, options = Task(*plain_task), Options(*plain_options)
    n, m = len(layout.base), len(x)
    program, counts = empty_program(n, m, room), np.zeros(2)
    counts[0] = steps
    now = _Search(layout, objective, task, program, np.empty(m), counts)
    here, there = empty_iterate(n, m, room), empty_iterate(n, m, room)
    after, point, reason = _iterate(now, goal_search, x, options, bound, here, there)
    x[:] = point.x
    return after, reason, point.values[0], int(counts[0]), int(counts[1])
