"""Our solver of windows: searches from many starts, certified together.

What certification finds joins as rows, and the search goes on: the exchange method of
semi-infinite programming, as in `planners.optimization.reference.exchange`, around a search that
already follows the nearest points of the whole curve and therefore seldom needs it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from ferguson_gym.runtime.arrays import Array
from planners.optimization.certification import Certified, Solution, certify
from planners.optimization.sqp.elastic_sqp import CONVERGED, ElasticSqp, Search, SearchState
from planners.optimization.window import Window

ROUNDS = 12
"""Most solves of one window."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MultiStart:
    """Elastic sequential quadratic programming from every start.

    The first start is searched first; the others are given up where they cannot better it.
    Then the best chain is moved aside, to both sides, and searched from once more: a search is
    local, and a neighbouring gap is often better.
    """

    search: ElasticSqp = field(default_factory=ElasticSqp)
    sidesteps: tuple[float, ...] = (8.0, 16.0)
    """How far the best chain's end is moved aside, to both sides [m]."""
    threads: int = 1
    """Threads that starts are shared out to. Results do not depend on it; it does not pay
    for windows of three segments, whose steps are shorter than a switch of threads."""

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Certified local minima from guesses (n, 4, 2), which need not be feasible.

        Raises:
            TypeError: a window among other obstacles than discs.
            ValueError: a guess that is not finite.
        """
        if not guesses:
            return []
        count = min(self.threads, len(guesses))
        workers = [Search(self.search, window, until) for _ in range(count)]
        ends = _solve(workers, guesses[:1], math.inf)
        ends += _solve(workers, guesses[1:], _rank(ends[0]))
        best = min(ends, key=_rank)
        if self.sidesteps and best.feasible and time.perf_counter() < until:
            sides = [chain for far in self.sidesteps for chain in offset_guesses(best.control, far)]
            aside = _solve(workers, sides, best.solution.objective)
            ends[ends.index(best)] = replace(
                min(best, *aside, key=_rank),
                evaluations=sum(end.evaluations for end in (best, *aside)),
                seconds=sum(end.seconds for end in (best, *aside)),
            )
        return ends


def offset_guesses(chain: Array, offset: float) -> list[Array]:
    """Guesses to both sides of a chain (n, 4, 2), the farther the later, the end by `offset`."""
    along = chain[-1, 1] - chain[0, 0]
    across = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    lean = np.linspace(0.0, offset, len(chain) + 1)[:, None] * across
    slope = np.broadcast_to(lean[1], lean[1:].shape)
    shift = np.stack([lean[:-1], lean[1:], slope, slope], axis=1)
    shift[0, 2] = 0.0
    return [chain - shift, chain + shift]


def _rank(end: Certified) -> float:
    return end.solution.objective if end.feasible else math.inf


def _solve(workers: Sequence[Search], guesses: Sequence[Array], bound: float) -> list[Certified]:
    """Search from each guess, certify all together, go on where that finds more contacts."""
    if not guesses:
        return []
    window = workers[0].window
    trails = _search(workers, guesses, bound)
    began = time.perf_counter()
    chains = [window.chain.control(trail.x) for trail in trails]
    feasible = certify(window, np.array(chains))
    seconds = (time.perf_counter() - began) / len(trails)
    ends = []
    for trail, chain, clear in zip(trails, chains, feasible, strict=True):
        while not clear and trail.rounds < ROUNDS:
            if not (np.isfinite(chain).all() and workers[0].join(trail, chain)):
                break
            workers[0].go_on(trail, bound)
            chain = window.chain.control(trail.x)
            clear = certify(window, chain[None])[0]
        ends.append(_end(trail, chain, bool(clear), trail.seconds + seconds))
    return ends


def _search(workers: Sequence[Search], guesses: Sequence[Array], bound: float) -> list[SearchState]:
    """One trail for each guess; each worker takes every so-many-th."""
    count = len(workers)
    if count == 1:
        return [workers[0].start(guess, bound) for guess in guesses]

    def share(worker: int) -> list[SearchState]:
        return [workers[worker].start(guess, bound) for guess in guesses[worker::count]]

    with ThreadPoolExecutor(count) as pool:
        shares = list(pool.map(share, range(count)))
    return [shares[index % count][index // count] for index in range(len(guesses))]


def _end(trail: SearchState, chain: Array, feasible: bool, seconds: float) -> Certified:
    solution = Solution(
        x=trail.x,
        objective=trail.objective,
        converged=trail.status == CONVERGED,
        status=trail.status,
        evaluations=trail.evaluations,
    )
    return Certified(
        solution=solution,
        control=chain,
        feasible=feasible,
        evaluations=trail.evaluations,
        rounds=trail.rounds,
        seconds=seconds,
    )
