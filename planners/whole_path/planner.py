"""Planners of whole paths: a route to the goal, fitted with segments."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from planners.interface import (
    CrashedError,
    Decision,
    Plan,
    Planner,
    Route,
    Router,
    Seconds,
    State,
    Status,
    WindowReport,
)
from planners.rollout import arriving, fly, over, rest
from planners.whole_path.route_fit import fit


@dataclass(frozen=True, slots=True, kw_only=True)
class WholePath:
    """A router's route as a flight; planned once, then tracked."""

    router: Router
    limits: Limits = PAPER_LIMITS

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal; what is left of an earlier plan is kept if it can be."""
        if (ended := over(field, state, self.limits)) is not None:
            return ended
        began = time.perf_counter()
        route: Route | None = None
        chain = rest(field, state, self.limits) if arriving(field, state) else None
        status, reason = Status.NOT_FITTED, ""
        if chain is None:
            try:
                route = self.router.route(field, state.vehicle, seed)
                status = status if route else Status.NO_ROUTE
            except CrashedError as error:
                status, reason = Status.CRASHED, str(error)
        if route is not None:
            chain = fit(route.points, field, state.vehicle, self.limits)
        ahead = np.empty((0, 4, 2)) if chain is None else chain
        control, states = fly(ahead, field, state, self.limits)
        if chain is not None and len(control) == len(chain):
            status = Status.SOLVED
        report = WindowReport(
            step=state.vehicle.segments,
            objective=math.nan if route is None else route.length,
            evaluations=0 if route is None else route.evaluations,
            seconds=time.perf_counter() - began,
        )
        return Plan(status, control, states, [Decision(chain, report)], route, reason)


def with_seconds(planner: Planner, seconds: float | None) -> Planner:
    """A planner whose router's budget is so many seconds; others, and for None, as they are."""
    if seconds is None or not isinstance(planner, WholePath):
        return planner
    router: Any = planner.router
    if not hasattr(router, "budget"):
        return planner
    bounded: Router = dataclasses.replace(router, budget=Seconds(seconds))
    return dataclasses.replace(planner, router=bounded)
