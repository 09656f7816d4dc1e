"""Planners of whole paths: segments fitted to a route to the goal."""

from __future__ import annotations

import dataclasses
import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from ferguson_gym.world.similarity import similarity
from planners.interface import (
    CrashedError,
    Decision,
    Knowledge,
    Plan,
    Planner,
    Route,
    Router,
    Seconds,
    State,
    Status,
    WindowReport,
)
from planners.rescaling import route_back, state_in_image
from planners.rollout import ends_on_goal, flight_plan, fly_chain, remaining_plan, terminal_plan
from planners.whole_path.route_fit import fit


class Fitter(Protocol):
    """Fits segments to routes."""

    def __call__(self, points: Array, field: Field, vehicle: transition.State) -> Array | None:
        """Certified segments (n, 4, 2) from a vehicle along a route (m, 2) to the goal, if any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WholePath:
    """Plans a route once and fits segments to it."""

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD

    router: Router
    fitter: Fitter = fit
    """Fits segments to the route."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal; a feasible rest of an earlier plan is returned."""
        if (ended := terminal_plan(field, state)) is not None:
            return ended
        began = time.perf_counter()
        chain, route, status, reason = self._chain(field, state, seed)
        flown = np.empty((0, 4, 2)) if chain is None else chain
        steps, states = fly_chain(flown, field, state)
        if chain is not None and len(steps) == len(chain):
            status = Status.SOLVED
        report = WindowReport(
            step=state.vehicle.segments,
            objective=math.nan if route is None else route.length,
            evaluations=0 if route is None else route.evaluations,
            seconds=time.perf_counter() - began,
        )
        return dataclasses.replace(
            flight_plan(field, status, steps, states),
            decisions=[Decision(chain, report, first_step=steps[0] if steps else None)],
            route=route,
            reason=reason,
        )

    def _chain(
        self, field: Field, state: State, seed: int
    ) -> tuple[Array | None, Route | None, Status, str]:
        """Segments (n, 4, 2) to the goal, their route, the status if they fail, and the reason."""
        if (seen := similarity(field)) is not None:
            found, route, status, reason = self._chain(
                seen.image, state_in_image(seen, state), seed
            )
            chain = None if found is None else seen.control_back(found)
            return chain, None if route is None else route_back(seen, route), status, reason
        if ends_on_goal(field, state) and (rest := remaining_plan(field, state)):
            return rest[0], None, Status.NOT_FITTED, ""
        try:
            route = self.router.route(field, state.vehicle, seed)
        except CrashedError as error:
            return None, None, Status.CRASHED, str(error)
        if route is None:
            return None, None, Status.NO_ROUTE, ""
        return self.fitter(route.points, field, state.vehicle), route, Status.NOT_FITTED, ""


def with_seconds(planner: Planner, seconds: float | None) -> Planner:
    """Give a planner's router a budget of wall-clock time [s].

    Without seconds, or without a router that has a budget, the planner is returned unchanged.
    """
    router: Any = getattr(planner, "router", None)
    if seconds is None or not isinstance(planner, WholePath) or not hasattr(router, "budget"):
        return planner
    return dataclasses.replace(planner, router=dataclasses.replace(router, budget=Seconds(seconds)))
