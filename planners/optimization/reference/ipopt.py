"""IPOPT through CasADi, for comparison: the sampled program with exact derivatives.

Applied to arrays of CasADi symbols, the NumPy functions of the problem give expressions that CasADi
differentiates. The window's position, its obstacles and the rows that certification adds are
parameters, so that one construction serves all windows of the same size. Needs the extra `bench`.

Reference:
    Wächter & Biegler (2006), On the implementation of an interior-point filter line-search
    algorithm for large-scale nonlinear programming, Mathematical Programming 106.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ferguson_gym.runtime.arrays import Array, GenericArray
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.world import Limits
from planners.optimization.certification import Solution
from planners.optimization.chain import Chain
from planners.optimization.nonlinear_program import Problem, Program
from planners.optimization.objectives import HorizonObjective
from planners.optimization.quadrature import lengths
from planners.optimization.sampled_constraints import (
    ClearanceAt,
    Constraint,
    LengthBounds,
    SampledClearance,
    SpeedAt,
    sample_weights,
)

_DISCS = 16
"""The number of discs is padded to a multiple of this."""
_ROWS = 64
"""Capacity of a construction for added rows; the latest are kept."""
_PADDING = 1e3
"""Position of padding discs and rows [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class _SymbolicDiscs:
    """Discs whose centres and radii are symbols."""

    centers: GenericArray
    radii: GenericArray

    def signed_distance(self, points: GenericArray) -> GenericArray:
        offset = points[..., None, :] - self.centers
        distance: GenericArray = np.sqrt(np.sum(offset * offset, axis=-1)) - self.radii
        return distance


@dataclass(frozen=True, slots=True)
class _Size:
    """The properties of a window that a construction depends on."""

    segments: int
    ends_held: bool
    discs: int
    samples: int
    alpha: float | None
    """Weight of directness; None for the length alone."""
    limits: Limits


@lru_cache(maxsize=16)
def _construct(size: _Size) -> Callable[..., dict[str, Any]]:
    """Construct the parametric program in CasADi, which takes about a second."""
    try:
        import casadi
    except ImportError as error:
        raise ImportError(f"IPOPT comes with CasADi: {installing('bench')}") from error

    symbols: list[Any] = []

    def unknown(*shape: int) -> GenericArray:
        symbol = casadi.SX.sym("p", int(np.prod(shape)))
        symbols.append(symbol)
        return np.array([symbol[k] for k in range(symbol.shape[0])], dtype=object).reshape(shape)

    n = size.segments
    free = np.ones((n + 1, 2, 2), dtype=np.bool_)
    free[0], free[-1, 0] = False, not size.ends_held
    x = unknown(int(free.sum()))
    chain = Chain(unknown(n + 1, 2, 2), free)
    goal, correction = unknown(2), unknown(n)
    discs: Any = _SymbolicDiscs(unknown(size.discs, 2), unknown(size.discs))
    weights, centers, radii = unknown(_ROWS, 4 * n), unknown(_ROWS, 2), unknown(_ROWS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # CasADi's, on NumPy calling its functions
        constraints: list[Constraint] = [
            LengthBounds(size.limits, correction),
            SampledClearance(discs, sample_weights(size.samples)),
        ]
        control = chain.control(x)
        length = np.sum(lengths(control))
        if size.alpha is None:
            objective = length
        else:
            horizon = HorizonObjective(chain.knots[0, 0], goal, size.alpha)
            objective = horizon.value(length, control[-1, 1])
        points = weights @ control.reshape(4 * n, 2)
        around = np.sqrt(np.sum((points - centers) ** 2, axis=-1)) - radii
        rows = [*(constraint.values(control) for constraint in constraints), around]
        solver: Callable[..., dict[str, Any]] = casadi.nlpsol(
            "window",
            "ipopt",
            {
                "x": symbols[0],
                "p": casadi.vertcat(*symbols[1:]),
                "f": objective,
                "g": casadi.vertcat(*np.concatenate(rows)),
            },
            {
                "ipopt.print_level": 0,
                "ipopt.sb": "yes",
                "print_time": False,
                "ipopt.max_iter": 300,
                "ipopt.constr_viol_tol": 1e-7,
                "ipopt.tol": 1e-6,
            },
        )
    return solver


@dataclass(frozen=True, slots=True)
class Ipopt:
    """IPOPT, its tolerances set for certification."""

    def solve(self, program: Program, guess: Array) -> Solution:
        """Start at `guess` (unknowns,), which need not be feasible.

        Added constraints on the bounds (`InsideAt`) are ignored; certification reports a violated
        bound again in the next round.

        Raises:
            ImportError: CasADi is not installed.
            TypeError: the program is not a chain among discs.
        """
        if not isinstance(program, Problem):
            raise TypeError(f"IPOPT needs a Problem, not {type(program).__name__}")
        problem = program
        solver: Any = _construct(_size(problem))
        low, high = problem.bounds
        end = solver(
            x0=np.clip(guess, low, high),
            p=_parameters(problem),
            lbx=low,
            ubx=high,
            lbg=0.0,
            ubg=np.inf,
        )
        x, stats = np.asarray(end["x"]).ravel(), solver.stats()
        return Solution(
            x=x if np.isfinite(x).all() else guess,
            objective=float(end["f"]),
            converged=bool(stats["success"]),
            status=str(stats["return_status"]),
            evaluations=int(stats["n_call_nlp_f"]),
        )


def _discs(problem: Problem) -> tuple[Array, Array]:
    """Centres and radii of the sampled discs."""
    for constraint in problem.constraints:
        if isinstance(constraint, SampledClearance):
            if not constraint.obstacles.are_discs:
                raise TypeError(
                    "IPOPT needs discs, since its distances are symbolic; ByExchange(Slsqp()) "
                    "solves windows among obstacles of every shape"
                )
            return constraint.obstacles.centers, constraint.obstacles.radii
    return np.empty((0, 2)), np.empty(0)


def _size(problem: Problem) -> _Size:
    if problem.bending_weight:
        raise ValueError(f"IPOPT needs a bending weight of zero, got {problem.bending_weight}")
    bounds = problem.constraints[0]
    assert isinstance(bounds, LengthBounds)
    sampled = [c for c in problem.constraints if isinstance(c, SampledClearance)]
    return _Size(
        segments=problem.chain.segments,
        ends_held=not bool(problem.chain.free[-1, 0].any()),
        discs=-(-len(_discs(problem)[1]) // _DISCS) * _DISCS,
        samples=1 + len(sampled[0].weights) if sampled else 2,
        alpha=getattr(problem.objective, "alpha", None),
        limits=bounds.limits,
    )


def _parameters(problem: Problem) -> Array:
    """The values of a construction's parameters, in its order."""
    n, size = problem.chain.segments, _size(problem)
    centers, radii = np.full((size.discs, 2), _PADDING), np.ones(size.discs)
    known, known_radii = _discs(problem)
    centers[: len(known)], radii[: len(known)] = known, known_radii
    correction = np.zeros(n)
    weights, around, least = np.zeros((0, n, 4)), np.zeros((0, 2)), np.zeros(0)
    for constraint in problem.constraints:
        if isinstance(constraint, LengthBounds):
            correction = constraint.correction
        if not isinstance(constraint, ClearanceAt | SpeedAt):
            continue
        rows = np.zeros((len(constraint.segment), n, 4))
        rows[np.arange(len(rows)), constraint.segment] = constraint.weights
        if isinstance(constraint, SpeedAt):
            place, size_of = np.zeros((len(rows), 2)), np.full(len(rows), constraint.slowest)
        else:
            discs = constraint.obstacles
            assert discs.are_discs
            place, size_of = discs.centers[constraint.obstacle], discs.radii[constraint.obstacle]
        weights, around = np.vstack([weights, rows]), np.vstack([around, place])
        least = np.concatenate([least, size_of])
    weights, around, least = weights[-_ROWS:], around[-_ROWS:], least[-_ROWS:]
    empty = _ROWS - len(least)
    return np.concatenate(
        [
            problem.chain.knots.ravel(),
            getattr(problem.objective, "goal", np.zeros(2)),
            correction,
            centers.ravel(),
            radii,
            weights.ravel(),
            np.zeros(empty * 4 * n),
            around.ravel(),
            np.full(empty * 2, _PADDING),
            least,
            np.zeros(empty),
        ]
    )
