"""Elastic sequential quadratic programming in a trust region: a window from one initial guess.

At unknowns x, with the multipliers lambda of the last step, the next step p solves the elastic
quadratic program of `planners.optimization.sqp.elastic_qp`: linearised lengths and contacts, and
the exact Hessian of the Lagrangian f - lambda.c, made definite. A filter accepts a step if it
reduces the objective or the violation compared with every remembered iterate.

A window is nearly flat in some directions: moving a joint along the curve or scaling a derivative
hardly changes the curve. `floor`, a lower bound on the model's curvature, limits steps in these
directions; it is reduced when the objective falls faster than predicted.

When the predicted gain of a step is small enough, the search ends with a feasibility restoration:
it projects its point onto the linearised constraints until the constraints are satisfied, lengths
by certified quadrature.

Reference:
    Nocedal & Wright (2006), Numerical optimization, 2nd edition, sections 18.5 and 18.8.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from ferguson_gym.curves.arc_length import length as certified_length
from ferguson_gym.runtime.arrays import Array
from planners.optimization.certification import target_tolerance
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp import elastic_qp
from planners.optimization.sqp.expansion import Layout, expand
from planners.optimization.sqp.filter import Filter
from planners.optimization.sqp.iterate import (
    Iterate,
    TrialStep,
    agreement,
    empty_iterate,
    layout_of,
    predict,
)
from planners.optimization.sqp.lagrangian import lagrangian, warm_start_multipliers
from planners.optimization.sqp.modified_ldl import make_definite
from planners.optimization.sqp.trust_region import TrustRegion
from planners.optimization.sqp.turn_contacts import too_sharp
from planners.optimization.window import Window

_FEASIBLE = 0.3
"""Sum of violations that counts as zero, as a fraction of the tolerance aimed for."""
_NEARLY_FEASIBLE = 1e-2
"""Violation [m] below which feasibility can be restored in a few steps."""
_RESTORED = 0.1
"""Radius [m] of the steps that restore the feasibility of an earlier iterate."""
_Box: TypeAlias = tuple[Array, Array]
CONVERGED = "converged"
ABANDONED = "abandoned, behind another guess"
DEADLINE = "deadline reached"
RESTORED = "ended at its best nearly feasible iterate"


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticSqp:
    """Options of a search."""

    precision: float = 1e-6
    """Relative predicted gain of a step below which the search stops."""
    iterations: int = 60
    """Maximum number of steps."""
    patience: float = 6.0
    """The search is abandoned if its objective exceeds the bound, the best of another guess, by
    more than this multiple of the predicted gain of a step."""
    radius: float = 2.0
    """Initial radius of the trust region for points [m]; three times as much for derivatives."""
    max_radius: float = 8.0
    """Maximum radius [m]."""
    floor: float = 3e-2
    """Initial lower bound on the curvature of the model [m per square of an unknown]."""
    max_violation: float = 2.0
    """Maximum total violation [m] of an iterate, or that of the initial guess if it is larger."""


@dataclass(slots=True, eq=False)
class SearchState:
    """The state of the search from one initial guess."""

    x: Array
    """Unknowns (m,)."""
    layout: Layout
    """The window, with the contacts that were pinned after certification failed."""
    objective: float = math.nan
    status: str = ""
    """How the search ended."""
    steps: int = 0
    evaluations: int = 0
    rounds: int = 0
    """Number of searches; 1 if the first result was certified."""
    seconds: float = 0.0


@dataclass(slots=True, eq=False)
class _Fallback:
    """The best nearly feasible iterate of a search."""

    x: Array | None = None
    objective: float = math.inf

    def keep(self, point: Iterate) -> None:
        """Copy a point if it is better."""
        if point.violation < _NEARLY_FEASIBLE and point.objective < self.objective:
            self.x, self.objective = point.x.copy(), point.objective


class Search:
    """Searches for local minima of one window, one after the other, reusing memory."""

    def __init__(self, options: ElasticSqp, window: Window, until: float) -> None:
        """Prepare searches that stop at `until` [s] on the clock of `time.perf_counter`."""
        obstacles, chain = window.obstacles, window.chain
        self.options, self.window, self.until = options, window, until
        self.box = window.box
        n, m = chain.segments, len(self.box[0])
        room = min(max(256, 4 * n * len(obstacles)), 4096)
        self.fresh = self.layout = layout_of(window, obstacles)
        self.cornered = not obstacles.are_discs
        self.end = self.fresh.place[-1, 2:4]
        kink = window.objective.kink
        self.kink = None if kink is None else (float(kink[0]), float(kink[1]))
        scale = np.ones(chain.free.shape)
        scale[:, 1] = 3.0
        self.scale = scale[chain.free]
        self.points = empty_iterate(n, m, room), empty_iterate(n, m, room)
        self.model = np.empty((m, m))
        self.rows = elastic_qp.empty_rows(n, m, room)
        self.evaluations = 0
        self.tolerance = target_tolerance(window.field)

    def start(self, guess: Array, bound: float) -> SearchState:
        """Search from a guess (n, 4, 2), and stop early if the objective cannot fall below `bound`.

        Raises:
            ValueError: a guess that is not finite.
        """
        if not np.isfinite(guess).all():
            raise ValueError(f"a guess must be finite, got {guess}")
        state = SearchState(np.clip(self.window.chain.unknowns(guess), *self.box), self.fresh)
        self.resume(state, bound)
        return state

    def resume(self, state: SearchState, bound: float) -> None:
        """Continue a search, for example with pinned contacts."""
        began = time.perf_counter()
        self.layout, self.evaluations = state.layout, 0
        point, state.status = self._descend(state, bound)
        state.x, state.objective, state.layout = point.x, point.objective, self.layout
        state.evaluations += self.evaluations
        state.rounds += 1
        state.seconds += time.perf_counter() - began

    def pin_contacts(self, state: SearchState, chain: Array) -> bool:
        """Add contacts at fixed parameters where certification fails; False if there are none."""
        if state.status not in (CONVERGED, ABANDONED, RESTORED):
            return False
        clear, t = self.window.obstacles.closest(chain)
        segment, obstacle = np.nonzero(clear < -self.tolerance)
        pinned = np.column_stack([segment, obstacle, t[segment, obstacle]])
        pinned = np.vstack([pinned, too_sharp(chain, self.window.turn_radius, self.tolerance)])
        every = np.vstack([state.layout.pinned_contacts, pinned])
        state.layout = state.layout._replace(pinned_contacts=every)
        return len(pinned) > 0

    def _descend(self, state: SearchState, bound: float) -> tuple[Iterate, str]:
        """Iterate; return the final iterate and the reason for stopping."""
        options = self.options
        region = TrustRegion(options.radius, options.floor, options.precision)
        here, there = self.points
        self._expand(here, state.x, elastic_qp.reach(region.radius))
        self._differentiate(here, here, np.zeros(len(here.tension)))
        accepted = Filter(max(options.max_violation, here.violation))
        nearest, fallback = math.inf, _Fallback()
        while True:
            if self.cornered:
                fallback.keep(here)
            if state.steps >= options.iterations:
                return self._fall_back(here, there, fallback, "out of iterations")
            if time.perf_counter() > self.until:
                return here, DEADLINE
            state.steps += 1
            distance = self._from_kink(here)
            if distance < min(region.radius, 0.5 * nearest):
                nearest = distance
                if self._restore_feasibility(here, there, region.radius, self._ending_on_kink()):
                    return there, CONVERGED
            trial = self._trial_step(here, region)
            if trial is None:
                region.after_failed_model()
                if region.collapsed:
                    return here, "no step found"
                continue
            if (reason := self._stops(here, trial, region.precision, bound)) is not None:
                if self._restore_feasibility(here, there, max(region.radius, 0.1), self.box):
                    return there, reason
                region.after_failed_restoration()
                if region.collapsed:
                    reason = "no feasible point near the end"
                    return self._fall_back(here, there, fallback, reason)
                continue
            accepted.add(here.objective, here.violation)
            self._expand(there, here.x + trial.p, elastic_qp.reach(max(region.radius, trial.size)))
            ratio = -1.0
            if accepted.accepts(there.objective, there.violation):
                ratio = agreement(here, there, trial.decrease)
            if ratio <= 0.0:
                region.after_rejected_step(trial.size)
                if region.collapsed:
                    return self._fall_back(here, there, fallback, "no step improves")
                continue
            self._differentiate(there, here, trial.multipliers)
            here, there = there, here
            region.after_accepted_step(ratio, trial.size, options.max_radius)

    def _fall_back(
        self, here: Iterate, there: Iterate, fallback: _Fallback, reason: str
    ) -> tuple[Iterate, str]:
        """The feasible point near the best nearly feasible iterate, or the last iterate."""
        if fallback.x is None or here.violation < _FEASIBLE * self.tolerance:
            return here, reason
        last = here.x.copy()
        self._expand(here, fallback.x, elastic_qp.reach(_RESTORED))
        if self._restore_feasibility(here, there, _RESTORED, self.box):
            return there, RESTORED
        self._expand(here, last, elastic_qp.reach(_RESTORED))
        return here, reason

    def _trial_step(self, here: Iterate, region: TrustRegion) -> TrialStep | None:
        """The step of the quadratic program; None if that has no solution."""
        make_definite(here.hessian, region.floor, self.model)
        p, multipliers = self._step(here, here.gradient, self.model, region.radius, self.box)
        if p is None:
            return None
        bounds = self.rows.lower, self.rows.upper
        predicted = predict(p, here.gradient, self.model, self.scale, multipliers, *bounds)
        return TrialStep(p, multipliers, *predicted)

    def _stops(self, here: Iterate, trial: TrialStep, precision: float, bound: float) -> str | None:
        """Why a nearly feasible search should end; None if it should go on."""
        little = trial.gain < precision * max(1.0, abs(here.objective))
        abandoned = here.objective - self.options.patience * trial.gain > bound
        if not (little or abandoned) or not here.violation < _NEARLY_FEASIBLE:
            return None
        return CONVERGED if little else ABANDONED

    def _expand(self, point: Iterate, x: Array, reach: float) -> None:
        point.x, here, objective = x, point.expansion, self.window.objective
        point.contacts, point.violation, length, bent = expand(x, self.layout, reach, here)
        value, point.slope, point.curvature = objective.expand(length, here.control[-1, 1])
        point.objective = value + bent
        self.evaluations += 1

    def _differentiate(self, point: Iterate, before: Iterate, multipliers: Array) -> None:
        """The Lagrangian at a point, with the multipliers of the step that led there."""
        chain = point.expansion, point.contacts
        pair = point.tension, point.multiplier
        old = before.expansion, self.rows.taken, multipliers
        warm_start_multipliers(*old, *chain, self.cornered, *pair)
        objective, out = (point.slope, point.curvature), (point.gradient, point.hessian)
        lagrangian(self.layout, *chain, *objective, *pair, BENDING, *out)

    def _step(
        self, point: Iterate, gradient: Array, hessian: Array, radius: float, box: _Box
    ) -> tuple[Array | None, Array]:
        here, model = (point.expansion, point.contacts, point.x), (gradient, hessian)
        limits = self.layout.limits
        return elastic_qp.solve(*here, box, self.scale, radius, limits, *model, self.rows)

    def _from_kink(self, point: Iterate) -> float:
        """Distance of the chain's end from the objective's kink [m]; infinite without one."""
        if self.kink is None:
            return math.inf
        x, y = point.expansion.control[-1, 1]
        return math.hypot(x - self.kink[0], y - self.kink[1])

    def _ending_on_kink(self) -> _Box:
        """Bounds that fix the chain's end at the kink."""
        low, high = self.box[0].copy(), self.box[1].copy()
        low[self.end] = high[self.end] = self.kink
        return low, high

    def _restore_feasibility(self, here: Iterate, there: Iterate, radius: float, box: _Box) -> bool:
        """Project a point onto the linearised constraints until `there` satisfies the true ones."""
        metric, no_gradient = np.diag(1.0 / self.scale**2), np.zeros(len(self.scale))
        point, violation = here, math.inf
        for _ in range(6):
            p, _ = self._step(point, no_gradient, metric, radius, box)
            if p is None:
                return False
            self._expand(there, point.x + p, elastic_qp.reach(radius))
            if there.violation < _FEASIBLE * self.tolerance:
                off = certified_length(there.expansion.control) - there.expansion.length
                if np.abs(off).max() < _FEASIBLE * self.tolerance:
                    return True
                self.layout = self.layout._replace(correction=self.layout.correction + off)
                self._expand(there, there.x, elastic_qp.reach(radius))
            if there.violation > 0.5 * violation:
                return False
            point, violation = there, there.violation
        return False
