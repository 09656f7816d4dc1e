"""Planning within some seconds: the best certified path so far, if the goal is not reached."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from ferguson_gym.world import Field, Outcome
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners.interface import Decision, Plan, Planner, Replanner, State, Status
from planners.receding_horizon import RecedingHorizon
from planners.rollout import fly_chain, roll_out
from planners.whole_path.planner import WholePath, with_seconds

_INSTANT = 1e-9
"""Least time that a decision is given [s]."""


@dataclass(frozen=True, slots=True)
class _OnTime:
    """A planner whose decisions end at a common time, as far as it can cut them short."""

    planner: Replanner
    until: float
    """As `time.perf_counter()` [s]."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal, or until the time is up."""
        return roll_out(self, field, state, seed, self.until)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones."""
        planner = self.planner
        if isinstance(planner, RecedingHorizon):
            left = max(self.until - time.perf_counter(), _INSTANT)
            planner = replace(planner, deadline=min(planner.deadline, left))
        return planner.decide(field, state, seed)


def check_deadline(planner: Planner, name: str | None = None) -> None:
    """Check that a planner can stop after some seconds; the message uses its name, if given.

    Raises:
        ValueError: it plans its whole path at once, without a budget of seconds.
    """
    if isinstance(planner, WholePath):
        stops = hasattr(planner.router, "budget")
    else:
        stops = isinstance(planner, Replanner)
    if not stops:
        raise ValueError(
            f"planner {name or type(planner).__name__} cannot stop at a deadline; planners that "
            "decide segment by segment (single-start, multi-start, guided, pursuit) or search "
            "within a budget (rrt, rrt-star, prm, bit-star, pso, abc) can"
        )


def plan_within(planner: Planner, field: Field, state: State, seed: int, seconds: float) -> Plan:
    """Plan from a state for some seconds of wall-clock time.

    A planner that decides segment by segment stops between two decisions; `RecedingHorizon` also
    ends its last search then. The rest of its last decision is flown as far as it is feasible, and
    completes the plan if it ends on the goal; otherwise the status is `OUT_OF_TIME`. A planner with
    a budget searches for that time, and then fits segments to its route.

    Args:
        planner: one that `check_deadline` accepts.
        field: where to plan.
        state: where the plan begins.
        seed: of the planner's random numbers.
        seconds: above 0.

    Raises:
        ValueError: seconds that are not positive and finite, or as `check_deadline`.
    """
    check_deadline(planner)
    if not 0.0 < seconds < np.inf:
        raise ValueError(f"a deadline is a number of seconds above 0, got {seconds}")
    until = time.perf_counter() + seconds
    if not isinstance(planner, Replanner):
        plan = with_seconds(planner, seconds).plan(field, state, seed)
        late = plan.status is Status.NO_ROUTE and time.perf_counter() >= until
        return replace(plan, status=Status.OUT_OF_TIME) if late else plan
    plan = _OnTime(planner, until).plan(field, state, seed)
    return _with_tail(plan, planner, field) if plan.status is Status.OUT_OF_TIME else plan


def _with_tail(plan: Plan, planner: Replanner, field: Field) -> Plan:
    """A plan that ran out of time, with the rest of its last decision as far as it is feasible."""
    if plan.decisions and plan.decisions[-1].known is not None:
        return plan  # the rest leads among obstacles that are not known yet
    limits, state = field.limits, plan.states[-1]
    chain = state.tail[: limits.segments - state.vehicle.segments]
    steps, states = fly_chain(chain, field, state)
    radius = getattr(planner, "min_turn_radius", None)
    if radius is not None:
        sharp = [not keeps_turn_radius(one.control, radius, limits.tolerance) for one in steps]
        steps = steps[: sharp.index(True)] if any(sharp) else steps
    if not steps:
        return plan
    arrived = steps[-1].outcome is Outcome.GOAL_REACHED
    certificates = [*(plan.certificates or ()), *(step.inspection for step in steps)]
    return replace(
        plan,
        status=Status.SOLVED if arrived else Status.OUT_OF_TIME,
        control=np.concatenate([plan.control, [step.control for step in steps]]),
        states=[*plan.states, *states[1 : len(steps) + 1]],
        certificates=certificates,
    )
