"""The paper's planner, changed in one thing at a time: what `paper_claims.py` flies.

All variants search as the paper does, from its starts alone: our step aside of the best chain is
left out. Flights may have as many segments as make 600 m, 40 of 15 m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from agents.flights.metrics import Interval
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from planners.interface import Planner
from planners.optimization.certification import WindowSolver
from planners.optimization.initial_guesses import no_guess
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.reference.two_stage import TwoSteps
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import WindowSettings
from planners.receding_horizon.paper import RecedingHorizon

SEARCH = MultiStart(sidesteps=())
SLSQP = ByExchange(Slsqp())


@dataclass(frozen=True, slots=True)
class Variant:
    """A planner, and how many of the fields it flies."""

    planner: Planner
    share: float = 1.0
    limits: Limits = PAPER_LIMITS


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A variant beside the reference of its group."""

    group: str
    variant: str
    fields: int
    success: float
    success_interval: Interval
    mcnemar: float
    """Chance of a difference in success so great if there were none."""
    spl: float
    spl_interval: Interval | None
    longer: float
    """Mean of length / the reference's length - 1, where both arrive."""
    longer_interval: Interval | None
    slower: float
    """Processor time a window over the reference's, geometric mean."""
    slower_interval: Interval | None
    costlier: float
    """Processor time of a flight over the reference's, geometric mean where both arrive."""
    evaluations: float
    reach: float
    winding: float


def _limits(longest: float) -> Limits:
    segments = math.ceil(PAPER_LIMITS.segments * PAPER_LIMITS.longest / longest)
    return replace(PAPER_LIMITS, longest=longest, segments=segments)


def _many(starts: int = 10, alpha: float = 0.2, longest: float = 15.0) -> Variant:
    planner = RecedingHorizon(
        random_starts=starts, solver=SEARCH, settings=WindowSettings(alpha=alpha)
    )
    return Variant(planner, limits=_limits(longest))


def _from_random(solver: WindowSolver = SEARCH) -> RecedingHorizon:
    """Single-start, each window from a random feasible guess and not from the shifted plan."""
    return RecedingHorizon(first_guess=no_guess, random_starts=1, solver=solver)


REFERENCE = "as the paper"
"""10 random starts beside the shifted plan, segments of at most 15 m, alpha 0.2."""
SINGLE = "15 m, single"
"""The same without random starts."""
GROUPS: dict[str, dict[str, Variant]] = {
    "longest segment": {
        "7.5 m": _many(longest=7.5),
        "10 m": _many(longest=10.0),
        "12.5 m": _many(longest=12.5),
        REFERENCE: _many(),
        "20 m": _many(longest=20.0),
        "30 m": _many(longest=30.0),
    },
    "longest segment, no random starts": {
        "7.5 m, single": _many(starts=0, longest=7.5),
        "10 m, single": _many(starts=0, longest=10.0),
        SINGLE: _many(starts=0),
        "20 m, single": _many(starts=0, longest=20.0),
        "30 m, single": _many(starts=0, longest=30.0),
    },
    "objective": {
        "alpha 0": _many(alpha=0.0),
        "alpha 0.05": _many(alpha=0.05),
        REFERENCE: _many(),
        "alpha 0.5": _many(alpha=0.5),
        "alpha 1": _many(alpha=1.0),
        "alpha 2": _many(alpha=2.0),
        "two steps": Variant(RecedingHorizon(solver=TwoSteps(search=SEARCH))),
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
        "random": Variant(_from_random()),
    },
    "first guess, SLSQP": {
        "shifted, SLSQP": Variant(RecedingHorizon(random_starts=0, solver=SLSQP), 0.1),
        "random, SLSQP": Variant(_from_random(SLSQP), 0.1),
    },
}
"""Variants by what they change. `REFERENCE` or `SINGLE`, or the first of a group without either, is
what the others are held against."""
