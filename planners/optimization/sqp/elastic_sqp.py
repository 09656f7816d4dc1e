"""Elastic sequential quadratic programming in a trust region: a window from one start.

At unknowns x, with multipliers lambda of the step before, the next step p solves the elastic
quadratic programme of `planners.optimization.sqp.elastic_qp`: linearised lengths and contacts, and
for H the exact Hessian of the Lagrangian f - lambda.c, made definite. A filter judges the step: it
must lessen the objective or the violation against every point before.

A window is flat along some directions: where a joint sits and how long a derivative is
hardly changes the curve. `floor`, the least curvature that H is given, limits steps along
them, and is lowered where the model proves too stiff.

When a step promises too little, the search settles on the nearest point that satisfies the
linearised constraints, again and again until it does so in fact, lengths by certified
quadrature.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np

from ferguson_gym.curves.arc_length import length as certified_length
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.world.obstacles import Discs
from planners.optimization.certification import AIM
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp import elastic_qp
from planners.optimization.sqp.expansion import Expansion, Layout, empty_expansion, expand
from planners.optimization.sqp.filter import Filter
from planners.optimization.sqp.lagrangian import lagrangian, warm_start_multipliers
from planners.optimization.sqp.modified_ldl import make_definite
from planners.optimization.sqp.turn_contacts import WIDER, too_sharp
from planners.optimization.window import Window

_MET = 0.3 * AIM
"""Violation [m], over all limits, that counts as none."""
_SETTLES = 1e-2
"""Violation [m] from which a search settles in a few steps."""
_SMALLEST = 1e-7
"""Radius [m] at which a search is stuck."""
CONVERGED = "converged"
OUTDONE = "outdone by another start"
DEADLINE = "deadline reached"


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticSqp:
    """Options of a search."""

    precision: float = 1e-6
    """Stop where a step promises a smaller part of the objective than this."""
    iterations: int = 60
    """Most steps."""
    patience: float = 6.0
    """Give up behind another start by this many times what a step promises."""
    radius: float = 2.0
    """Radius of the trust region at first, for points [m]; three times it for derivatives."""
    widest: float = 8.0
    """Greatest radius [m]."""
    floor: float = 3e-2
    """Least curvature of the model at first [m per square of an unknown]."""
    detour: float = 2.0
    """Violation [m] that a search may pass through, or that of its start if it is more."""


@dataclass(slots=True, eq=False)
class SearchState:
    """One start: where its search has come to."""

    x: Array
    """Unknowns (m,)."""
    layout: Layout
    """The window, with what certification added."""
    objective: float = math.nan
    status: str = ""
    """How the search ended."""
    steps: int = 0
    evaluations: int = 0
    rounds: int = 0
    """Searches, 1 if certification added nothing."""
    seconds: float = 0.0


@dataclass(slots=True, eq=False)
class _Point:
    """Unknowns, and the window expanded there."""

    expansion: Expansion
    x: Array
    gradient: Array
    """(m,) of the objective."""
    hessian: Array
    """(m, m) of the Lagrangian."""
    multiplier: Array
    """(room,) of each contact, >= 0."""
    tension: Array
    """(n,) multiplier of each length: positive at the shortest, negative at the longest."""
    contacts: int = 0
    violation: float = 0.0
    """Sum of what limits lack [m]."""
    objective: float = 0.0
    slope: Array = field(default_factory=lambda: np.empty(3))
    """(3,) gradient of the objective with respect to length and end."""
    curvature: Array = field(default_factory=lambda: np.empty((3, 3)))
    """(3, 3) its Hessian."""


def _empty_point(segments: int, unknowns: int, room: int) -> _Point:
    return _Point(
        expansion=empty_expansion(segments, unknowns, room),
        x=np.empty(unknowns),
        gradient=np.empty(unknowns),
        hessian=np.empty((unknowns, unknowns)),
        multiplier=np.empty(room),
        tension=np.empty(segments),
    )


@compiled
def _foresee(
    p: Array,
    gradient: Array,
    hessian: Array,
    scale: Array,
    multipliers: Array,
    lower: Array,
    upper: Array,
) -> tuple[float, float, float]:
    """What a step p is to bring.

    Returns:
        By how much the model of the objective falls along p; the same plus what p pays for
        mending rows that are broken, at their multipliers; p's size in the trust region.
    """
    fall = size = 0.0
    m = len(p)
    for i in range(m):
        size = max(size, abs(p[i]) / scale[i])
        row = 0.0
        for j in range(m):
            row += hessian[i, j] * p[j]
        fall -= p[i] * (gradient[i] + 0.5 * row)
    promise = fall
    for row in range(len(multipliers)):
        if multipliers[row] > 0.0:
            promise += multipliers[row] * max(0.0, lower[m + row])
        else:
            promise += multipliers[row] * min(0.0, upper[m + row])
    return fall, promise, size


def _ratio(here: _Point, there: _Point, fall: float) -> float:
    """Fall of the objective over what was foreseen, where that is what a step is for."""
    if fall <= 1e-4 * here.violation:
        return 0.5
    ratio = (here.objective - there.objective) / fall
    return max(ratio, 1e-3) if there.violation < 0.9 * here.violation else ratio


def _layout(window: Window, discs: Discs) -> Layout:
    chain, limits = window.chain, window.limits
    places = np.full(chain.free.shape, -1, np.int64)
    places[chain.free] = np.arange(chain.free.sum())
    # rows start, end, start derivative, end derivative, as in a control array
    place = np.stack([places[:-1, 0], places[1:, 0], places[:-1, 1], places[1:, 1]], axis=1)
    return Layout(
        base=chain.control(np.zeros(int(chain.free.sum()))),
        place=place.reshape(-1, 8),
        bounds=window.field.bounds,
        centers=discs.centers,
        radii=discs.radii,
        slowest=limits.slowest,
        limits=np.array([limits.shortest, limits.longest]),
        stiffness=window.stiffness,
        correction=np.zeros(chain.segments),
        held=np.empty((0, 3)),
        turn_radius=WIDER * window.turn_radius,
    )


class Search:
    """Searches for local minima of one window, one after the other, in the same memory.

    Raises:
        TypeError: a window among other obstacles than discs.
    """

    def __init__(self, options: ElasticSqp, window: Window, until: float) -> None:
        """For `until` [s] on the clock of `time.perf_counter`."""
        discs, chain = window.obstacles, window.chain
        if not isinstance(discs, Discs):
            raise TypeError(
                f"this solver knows discs, not {type(discs).__name__}; "
                "planners.optimization.reference.exchange.ByExchange solves windows among any "
                "obstacles"
            )
        self.options, self.window, self.until = options, window, until
        self.box = window.box
        n, m = chain.segments, len(self.box[0])
        room = min(max(256, 4 * n * len(discs)), 4096)
        self.fresh = self.layout = _layout(window, discs)
        self.end = self.fresh.place[-1, 2:4]
        tip = window.objective.tip
        self.tip = None if tip is None else (float(tip[0]), float(tip[1]))
        scale = np.ones(chain.free.shape)
        scale[:, 1] = 3.0
        self.scale = scale[chain.free]
        self.points = _empty_point(n, m, room), _empty_point(n, m, room)
        self.model = np.empty((m, m))
        self.rows = elastic_qp.empty_rows(n, m, room)
        self.evaluations = 0

    def start(self, guess: Array, bound: float) -> SearchState:
        """Search from a guess (n, 4, 2), to give up where it cannot better `bound`.

        Raises:
            ValueError: a guess that is not finite.
        """
        if not np.isfinite(guess).all():
            raise ValueError(f"a guess must be finite, got {guess}")
        trail = SearchState(np.clip(self.window.chain.unknowns(guess), *self.box), self.fresh)
        self.go_on(trail, bound)
        return trail

    def go_on(self, trail: SearchState, bound: float) -> None:
        """Search from where a trail has come to."""
        began = time.perf_counter()
        self.layout, self.evaluations = trail.layout, 0
        point, trail.status = self._descend(trail, bound)
        trail.x, trail.objective, trail.layout = point.x, point.objective, self.layout
        trail.evaluations += self.evaluations
        trail.rounds += 1
        trail.seconds += time.perf_counter() - began

    def join(self, trail: SearchState, chain: Array) -> bool:
        """Take in the contacts that certification finds broken; whether that may help."""
        if trail.status not in (CONVERGED, OUTDONE):
            return False
        clear, t = self.window.obstacles.closest(chain)
        segment, disc = np.nonzero(clear < -AIM)
        held = np.column_stack([segment, disc, t[segment, disc]])
        held = np.vstack([held, too_sharp(chain, self.window.turn_radius, AIM)])
        trail.layout = trail.layout._replace(held=np.vstack([trail.layout.held, held]))
        return len(held) > 0

    def _descend(self, trail: SearchState, bound: float) -> tuple[_Point, str]:
        """Where a search ends, and how."""
        options = self.options
        radius, floor, precision = options.radius, options.floor, options.precision
        here, there = self.points
        self._expand(here, trail.x, elastic_qp.reach(radius))
        self._differentiate(here, here, np.zeros(len(here.tension)))
        seen = Filter(max(options.detour, here.violation))
        nearest = math.inf
        while True:
            if trail.steps >= options.iterations:
                return here, "out of iterations"
            if time.perf_counter() > self.until:
                return here, DEADLINE
            trail.steps += 1
            distance = self._from_tip(here)
            if distance < min(radius, 0.5 * nearest):
                nearest = distance
                if self._settle(here, there, radius, self._ending_on_tip()):
                    return there, CONVERGED
            make_definite(here.hessian, floor, self.model)
            p, multipliers = self._step(here, here.gradient, self.model, radius, self.box)
            if p is None:
                radius, floor = 0.25 * radius, 10.0 * floor
                if radius < _SMALLEST:
                    return here, "no step found"
                continue
            fall, promise, size = _foresee(
                p,
                here.gradient,
                self.model,
                self.scale,
                multipliers,
                self.rows.lower,
                self.rows.upper,
            )
            little = promise < precision * max(1.0, abs(here.objective))
            outdone = here.objective - options.patience * promise > bound
            if (little or outdone) and here.violation < _SETTLES:
                if self._settle(here, there, max(radius, 0.1), self.box):
                    return there, CONVERGED if little else OUTDONE
                radius, precision = 0.5 * radius, 0.25 * precision
                if radius < _SMALLEST:
                    return here, "no feasible point near the end"
                continue
            seen.add(here.objective, here.violation)
            self._expand(there, here.x + p, elastic_qp.reach(max(radius, size)))
            accepted = seen.accepts(there.objective, there.violation)
            ratio = _ratio(here, there, fall) if accepted else -1.0
            if ratio <= 0.0:
                radius = 0.25 * size
                if radius < _SMALLEST:
                    return here, "no step improves"
                continue
            self._differentiate(there, here, multipliers)
            here, there = there, here
            if ratio > 0.75 and size > 0.9 * radius:
                radius = min(2.0 * radius, options.widest)
            elif ratio < 0.25:
                radius = 0.5 * size
            elif ratio > 1.1:
                floor = max(0.1 * floor, 1e-6)

    def _expand(self, point: _Point, x: Array, reach: float) -> None:
        point.x = x
        point.contacts, point.violation, length, bent = expand(
            x, self.layout, reach, point.expansion
        )
        value, point.slope, point.curvature = self.window.objective.expand(
            length, point.expansion.control[-1, 1]
        )
        point.objective = value + bent
        self.evaluations += 1

    def _differentiate(self, point: _Point, before: _Point, multipliers: Array) -> None:
        """The Lagrangian at a point, with the multipliers of the step that led there."""
        warm_start_multipliers(
            before.expansion,
            self.rows.taken,
            multipliers,
            point.expansion,
            point.contacts,
            point.tension,
            point.multiplier,
        )
        lagrangian(
            self.layout,
            point.expansion,
            point.contacts,
            point.slope,
            point.curvature,
            point.tension,
            point.multiplier,
            BENDING,
            point.gradient,
            point.hessian,
        )

    def _step(
        self,
        point: _Point,
        gradient: Array,
        hessian: Array,
        radius: float,
        box: tuple[Array, Array],
    ) -> tuple[Array | None, Array]:
        return elastic_qp.solve(
            point.expansion,
            point.contacts,
            point.x,
            box,
            self.scale,
            radius,
            self.layout.limits,
            gradient,
            hessian,
            self.rows,
        )

    def _from_tip(self, point: _Point) -> float:
        """Distance of the chain's end from the objective's tip [m]; infinite without one."""
        if self.tip is None:
            return math.inf
        x, y = point.expansion.control[-1, 1]
        return math.hypot(x - self.tip[0], y - self.tip[1])

    def _ending_on_tip(self) -> tuple[Array, Array]:
        """The box with the chain's end held at the tip, where no smooth model would take it."""
        low, high = self.box[0].copy(), self.box[1].copy()
        low[self.end] = high[self.end] = self.tip
        return low, high

    def _settle(self, here: _Point, there: _Point, radius: float, box: tuple[Array, Array]) -> bool:
        """Whether projection onto the linearised constraints leads `there` to satisfy them."""
        flat, none = np.diag(1.0 / self.scale**2), np.zeros(len(self.scale))
        point, violation = here, math.inf
        for _ in range(6):
            p, _ = self._step(point, none, flat, radius, box)
            if p is None:
                return False
            self._expand(there, point.x + p, elastic_qp.reach(radius))
            if there.violation < _MET:
                off = certified_length(there.expansion.control) - there.expansion.length
                if np.abs(off).max() < _MET:
                    return True
                self.layout = self.layout._replace(correction=self.layout.correction + off)
                self._expand(there, there.x, elastic_qp.reach(radius))
            if there.violation > 0.5 * violation:
                return False
            point, violation = there, there.violation
        return False
