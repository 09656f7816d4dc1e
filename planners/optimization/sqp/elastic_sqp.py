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
by certified quadrature. The search itself is compiled: `planners.optimization.sqp.descent`.

Reference:
    Nocedal & Wright (2006), Numerical optimization, 2nd edition, sections 18.5 and 18.8.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.partial_graph import PartialGraph
from planners.optimization.certification import target_tolerance
from planners.optimization.distance_objective import ToGoObjective
from planners.optimization.sqp import descent
from planners.optimization.sqp.expansion import Layout
from planners.optimization.sqp.iterate import layout_of
from planners.optimization.sqp.objective_values import objective_values
from planners.optimization.sqp.turn_contacts import too_sharp
from planners.optimization.window import Window

CONVERGED = "converged"
ABANDONED = "abandoned, behind another guess"
DEADLINE = "deadline reached"
RESTORED = "ended at its best nearly feasible iterate"
_REASONS = {
    descent.CONVERGED: CONVERGED,
    descent.ABANDONED: ABANDONED,
    descent.DEADLINE: DEADLINE,
    descent.RESTORED: RESTORED,
    descent.OUT_OF_ITERATIONS: "out of iterations",
    descent.NO_STEP: "no step found",
    descent.NO_FEASIBLE_POINT: "no feasible point near the end",
    descent.NO_IMPROVEMENT: "no step improves",
}


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

    @property
    def values(self) -> descent.Options:
        """The options, for the compiled search."""
        return descent.Options(
            float(self.precision),
            int(self.iterations),
            float(self.patience),
            float(self.radius),
            float(self.max_radius),
            float(self.floor),
            float(self.max_violation),
        )


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


class Search:
    """Searches for local minima of one window, one after the other."""

    def __init__(self, options: ElasticSqp, window: Window, until: float) -> None:
        """Prepare searches; none begins after `until` [s] on the clock of `time.perf_counter`."""
        obstacles, chain, objective = window.obstacles, window.chain, window.objective
        self.window, self.until = window, until
        self.box = window.box
        self.fresh = layout_of(window, obstacles)
        self.tolerance = target_tolerance(window.field)
        scale = np.ones(chain.free.shape)
        scale[:, 1] = 3.0
        kink = np.empty(0) if objective.kink is None else np.array(objective.kink, float)
        cornered = not obstacles.are_discs
        cornered_field = not window.field.obstacles.are_discs
        self._task = *self.box, scale[chain.free], kink, self.tolerance, cornered
        self._room = min(max(256, 4 * chain.segments * len(obstacles)), 4096)
        self._options = tuple(options.values)
        self._at_once = tuple(options.values._replace(iterations=0))
        togo = objective.togo if isinstance(objective, ToGoObjective) else None
        self._togo, partial = togo, togo is not None and togo.tracks is None
        self._by_search = partial and not cornered_field
        self._by_parts = partial and cornered_field

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
        late = began > self.until
        options = self._at_once if late else self._options
        while True:
            # copies, since the search moves both
            x, correction = state.x.copy(), state.layout.correction.copy()
            layout = state.layout._replace(correction=correction)
            plain = *layout[:5], tuple(layout.cores), *layout[6:]
            graph = self._graph(x)
            objective = objective_values(self.window.objective, graph)
            search = self._togo.borrow() if self._togo and self._by_search else None
            after, reason, value, steps, evaluations = descent.descend(
                plain, objective, self._task, search, x, options, state.steps, bound, self._room
            )
            if self._togo is not None and after is not None:
                self._togo.searches.append(after)
            # until the graph has all obstacles on which the result depends
            if self._graph(x) is graph:
                break
        state.layout = layout
        state.x, state.objective, state.steps = x, value, steps
        state.status = DEADLINE if late else _REASONS[reason]
        state.evaluations += evaluations
        state.rounds += 1
        state.seconds += time.perf_counter() - began

    def _graph(self, x: Array) -> PartialGraph | None:
        """The graph that covers the end of a chain, where paths come from a part of obstacles."""
        if self._togo is None or not self._by_parts:
            return None
        self._togo(self.window.chain.control(x)[-1:, 1])
        return self._togo.graphs[-1]

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
