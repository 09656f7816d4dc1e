"""The paper's planner, changed in one thing at a time: what `paper_claims.py` flies.

All variants search as the paper does, from its starts alone: our step aside of the best chain is
left out. Flights may have as many segments as make 600 m, 40 of 15 m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ferguson_gym.arrays import Array
from ferguson_gym.fields import Field
from ferguson_gym.limits import PAPER_LIMITS, Limits
from planners.exchange import ByExchange, Certified, WindowSolver
from planners.interface import Decision, Plan, Planner, State
from planners.multi_start import MultiStart
from planners.objectives import HorizonObjective, LengthObjective
from planners.receding_horizon import RecedingHorizon
from planners.rollout import roll_out
from planners.solvers import Slsqp
from planners.starts import random_chains
from planners.window import Window, WindowSettings

SEARCH = MultiStart(sidesteps=())
SLSQP = ByExchange(Slsqp())
DRAWS = (10, 100, 1000)
"""Draws of a random first guess; more only where none was feasible, as in `multi-start`."""


@dataclass(frozen=True, slots=True)
class TwoSteps:
    """Windows solved twice: for the distance left, then for the length to the end point found.

    Reference:
        The paper, section III-C2, which proposes it and prefers the single objective.
    """

    search: WindowSolver = SEARCH

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Certified chains from guesses (n, 4, 2), ranked by the distance that they leave."""
        if not isinstance(window.objective, HorizonObjective):
            return self.search.solve(window, guesses, until)
        nearest = replace(window, objective=replace(window.objective, alpha=0.0))
        return [
            self._straightened(window, end, until)
            for end in self.search.solve(nearest, guesses, until)
        ]

    def _straightened(self, window: Window, end: Certified, until: float) -> Certified:
        """The shortest chain to where one ends, that counts as much as that one."""
        if not end.feasible:
            return end
        chain = window.chain.ending_at(end.control[-1, 1])
        shorter = replace(window, chain=chain, objective=LengthObjective())
        (found,) = self.search.solve(shorter, [end.control], until)
        spent = {
            "evaluations": end.evaluations + found.evaluations,
            "seconds": end.seconds + found.seconds,
        }
        if not found.feasible:
            return replace(end, **spent)
        solution = replace(found.solution, objective=end.solution.objective)
        return replace(found, solution=solution, **spent)


class RandomChain:
    """Proposes one random feasible chain."""

    def __init__(self, planner: RecedingHorizon) -> None:
        self._planner = planner

    def propose(self, field: Field, state: State, segments: int, seed: int) -> Sequence[Array]:
        """The first random chain that a window admits; none if it admits none of many."""
        window = self._planner.window(field, state)
        stream = np.random.default_rng([seed, state.segments])
        for draws in DRAWS:
            count = window.chain.segments
            drawn = random_chains(stream, state, count, self._planner.limits, draws)
            if (admitted := window.admits(drawn)).any():
                return [drawn[admitted.argmax()]]
        return []


@dataclass(frozen=True)
class FromRandom:
    """Single-start, each window from a random feasible guess and not from the shifted plan.

    Reference:
        The paper, section III-C6.
    """

    solver: WindowSolver = SEARCH
    limits: Limits = PAPER_LIMITS

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal."""
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """The segments that the random guess leads to; none where it leads to nothing."""
        plain = RecedingHorizon(random_starts=0, solver=self.solver, limits=self.limits)
        started = replace(plain, proposer=RandomChain(plain), polish=self.solver)
        decision = started.decide(field, state, seed)
        return decision if _without_shifted(decision) else replace(decision, chain=None)


def _without_shifted(decision: Decision) -> bool:
    return decision.report.start not in ("shifted", "straight")


@dataclass(frozen=True, slots=True)
class Variant:
    """A planner, and how many of the fields it flies."""

    planner: Planner
    share: float = 1.0


def _many(starts: int = 10, alpha: float = 0.2, longest: float = 15.0) -> Variant:
    segments = math.ceil(PAPER_LIMITS.segments * PAPER_LIMITS.longest / longest)
    return Variant(
        RecedingHorizon(
            random_starts=starts,
            solver=SEARCH,
            settings=WindowSettings(alpha=alpha),
            limits=replace(PAPER_LIMITS, longest=longest, segments=segments),
        )
    )


REFERENCE = "as the paper"
"""10 random starts beside the shifted plan, segments of at most 15 m, alpha 0.2."""
GROUPS: dict[str, dict[str, Variant]] = {
    "longest segment": {
        "7.5 m": _many(longest=7.5),
        "10 m": _many(longest=10.0),
        "12.5 m": _many(longest=12.5),
        REFERENCE: _many(),
    },
    "objective": {
        "alpha 0": _many(alpha=0.0),
        "alpha 0.05": _many(alpha=0.05),
        REFERENCE: _many(),
        "alpha 0.5": _many(alpha=0.5),
        "alpha 1": _many(alpha=1.0),
        "alpha 2": _many(alpha=2.0),
        "two steps": Variant(RecedingHorizon(solver=TwoSteps())),
    },
    "random starts": {
        "0 starts": _many(starts=0),
        "1 start": _many(starts=1),
        "3 starts": _many(starts=3),
        REFERENCE: _many(),
        "30 starts": _many(starts=30),
    },
    "first guess": {
        "shifted": _many(starts=0),
        "random": Variant(FromRandom()),
    },
    "first guess, SLSQP": {
        "shifted, SLSQP": Variant(RecedingHorizon(random_starts=0, solver=SLSQP), 0.1),
        "random, SLSQP": Variant(FromRandom(SLSQP), 0.1),
    },
}
"""Variants by what they change; the first of a group, or `REFERENCE`, is what others are held
against."""
