"""Planners of whole paths: a route to the goal, fitted with segments."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.flight import follow
from ferguson_gym.limits import PAPER_LIMITS, Limits
from planners.fit import fit
from planners.interface import Decision, Plan, State, Status, WindowReport
from planners.routes import CrashedError, Route, Router


@dataclass(frozen=True, slots=True, kw_only=True)
class WholePath:
    """A router's route as a flight; planned once, then tracked."""

    router: Router
    limits: Limits = PAPER_LIMITS

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal."""
        began = time.perf_counter()
        route: Route | None = None
        chain: Array | None = None
        try:
            route = self.router.route(field, state.vehicle, seed)
        except CrashedError:
            status = Status.CRASHED
        else:
            status = Status.NO_ROUTE if route is None else Status.NOT_FITTED
        if route is not None:
            chain = fit(route.points, field, state.vehicle, self.limits)
        states, flown = [state], []
        for segment in np.empty((0, 4, 2)) if chain is None else chain:
            # rounded as the environment flies it, so that plan and flight are equal bit for bit
            step = follow(field, states[-1].vehicle, segment, self.limits)
            if not step.flown:
                break
            flown.append(step.control)
            assert chain is not None
            states.append(State(step.state, chain[len(flown) :]))
        if chain is not None and len(flown) == len(chain):
            status = Status.SOLVED
        report = WindowReport(
            step=state.vehicle.segments,
            objective=math.nan if route is None else route.length,
            evaluations=0 if route is None else route.evaluations,
            seconds=time.perf_counter() - began,
        )
        control = np.array(flown).reshape(-1, 4, 2)
        return Plan(status, control, states, [Decision(chain, report)], route)
