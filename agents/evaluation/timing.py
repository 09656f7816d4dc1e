"""Timing: some flights of each policy are repeated alone to measure decision times.

During an evaluation workers share the machine, and agents decide for many flights at once, so times
measured then do not show what a policy costs in use.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from agents.evaluation.request import Request
from agents.flights import fly
from agents.flights.metrics import quantile
from agents.policies import make_policy
from agents.policies.warm_up import warm_policy
from agents.runtime.interrupts import raise_if_interrupted

MOST = 20
"""Maximum number of timed flights of a policy."""
BUDGET = 2.0
"""Seconds after which no further flight of a policy starts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Times of a policy's flights, flown one after the other."""

    policy: str
    decisions: Sequence[float]
    """Time of each decision of all flights [s]."""
    flights: Sequence[float]
    """Time of each flight [s]: deciding, certifying and flying every segment."""

    def summary(self) -> dict[str, float | int | None]:
        """Entries of summary.json; None without a measurement."""
        return {
            "timed_flights": len(self.flights),
            "timed_decisions": len(self.decisions),
            "decision_seconds_median": quantile(self.decisions, 0.5),
            "decision_seconds_99": quantile(self.decisions, 0.99),
            "flight_seconds_median": quantile(self.flights, 0.5),
        }


def measure(request: Request, policy: str, budget: float = BUDGET) -> Timing:
    """Time a policy on flights that are evenly spread over those of a request.

    After `budget` seconds no further flight starts; the first one always does.

    Raises:
        ValueError: An agent cannot be loaded.
        KeyboardInterrupt: After a flight, if Ctrl-C was deferred.
    """
    ready = make_policy(policy)  # agents are ready when they are loaded
    warm_policy(policy)
    decisions: list[float] = []
    flights: list[float] = []
    began = time.perf_counter()
    for index in _spread(request.each, MOST):
        source, seed = request.flight(index)
        flown = fly(ready, request.field(source), seed, name=policy)
        decisions += flown.decision_seconds
        flights.append(flown.seconds)
        raise_if_interrupted()
        if time.perf_counter() - began > budget:
            break
    return Timing(policy=policy, decisions=decisions, flights=flights)


def _spread(number: int, most: int) -> list[int]:
    """Indices below a number, evenly spread, in an order whose first few are spread as well."""
    even = np.linspace(0, number - 1, min(number, most)).round().astype(int).tolist()
    order: list[int] = []
    step = len(even)
    while len(order) < len(even):
        order += [k for k in range(0, len(even), max(step, 1)) if k not in order]
        step //= 2
    return [even[k] for k in order]
