"""The paper's alternative to one weighted objective: first the distance, then the length."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from ferguson_gym.runtime.arrays import Array
from planners.optimization import MultiStart, Window
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.objectives import HorizonObjective, LengthObjective


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSteps:
    """Minimises the remaining distance, and then the length of the best chain.

    The window's weight of directness is ignored. Windows with another objective, such as the length
    to the goal, are solved unchanged.

    Reference:
        The paper, section III-C2.
    """

    search: WindowSolver = field(default_factory=MultiStart)
    """Solves both problems."""

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Find certified chains from guesses (n, 4, 2); the objective is the remaining distance."""
        if not isinstance(window.objective, HorizonObjective):
            return self.search.solve(window, guesses, until)
        nearest = replace(window, objective=replace(window.objective, alpha=0.0))
        ends = self.search.solve(nearest, guesses, until)
        if certified := [end for end in ends if end.feasible]:
            best = min(certified, key=lambda end: end.solution.objective)
            place = next(k for k, end in enumerate(ends) if end is best)
            ends[place] = self._straightened(window, best, until)
        return ends

    def _straightened(self, window: Window, end: Certified, until: float) -> Certified:
        """The shortest chain to the end of another one, or that one if the solver fails."""
        chain = window.chain.ending_at(end.control[-1, 1])
        shorter = replace(window, chain=chain, objective=LengthObjective())
        (found,) = self.search.solve(shorter, [end.control], until)
        kept, evaluations = found if found.feasible else end, end.evaluations + found.evaluations
        x, objective = window.chain.unknowns(kept.control), end.solution.objective
        solution = replace(kept.solution, x=x, objective=objective, evaluations=evaluations)
        seconds = end.seconds + found.seconds
        return replace(kept, solution=solution, evaluations=evaluations, seconds=seconds)
