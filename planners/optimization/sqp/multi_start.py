"""The planners' solver of windows: searches from many initial guesses, certified together.

Where certification fails, the contacts it finds are pinned and the search is resumed: the exchange
method of semi-infinite programming, as in `planners.optimization.reference.exchange`. It is seldom
needed, since the search already follows the nearest points of the whole curve.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np

from ferguson_gym.runtime.arrays import Array
from planners.optimization.certification import MAX_SOLVES, Certified, Solution, certify
from planners.optimization.sqp.elastic_sqp import CONVERGED, ElasticSqp, Search, SearchState
from planners.optimization.window import Window


@dataclass(frozen=True, slots=True, kw_only=True)
class MultiStart:
    """Elastic sequential quadratic programming from every initial guess.

    The first guess is optimised first; others are abandoned if they cannot improve on its result.
    Then the best chain is shifted to both sides and optimised again: a search is local, and passing
    between neighbouring obstacles is often shorter.
    """

    search: ElasticSqp = field(default_factory=ElasticSqp)
    sidesteps: tuple[float, ...] = (8.0, 16.0)
    """Distances by which the end of the best chain is shifted to both sides [m]."""
    threads: int = 1
    """Number of threads. Results do not depend on it. More than one does not pay for windows of
    three segments, whose steps take less time than switching threads."""

    def solve(
        self, window: Window, guesses: Sequence[Array], until: float = math.inf
    ) -> list[Certified]:
        """Certified local minima from guesses (n, 4, 2), which need not be feasible.

        Raises:
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
    """A chain (n, 4, 2) sheared to the left and to the right: its end moves by `offset` [m]."""
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
    """Search from each guess, certify all results together, and resume those that fail."""
    if not guesses:
        return []
    window = workers[0].window
    states = _search(workers, guesses, bound)
    began = time.perf_counter()
    chains = [window.chain.control(state.x) for state in states]
    feasible = certify(window, np.array(chains))
    seconds = (time.perf_counter() - began) / len(states)
    ends = []
    for state, chain, clear in zip(states, chains, feasible, strict=True):
        while not clear and state.rounds < MAX_SOLVES:
            if not (np.isfinite(chain).all() and workers[0].pin_contacts(state, chain)):
                break
            workers[0].resume(state, bound)
            chain = window.chain.control(state.x)
            clear = certify(window, chain[None])[0]
        ends.append(_end(state, chain, bool(clear), state.seconds + seconds))
    return ends


def _search(workers: Sequence[Search], guesses: Sequence[Array], bound: float) -> list[SearchState]:
    """Search from each guess; guesses are distributed round-robin to the workers."""
    count = len(workers)
    if count == 1:
        return [workers[0].start(guess, bound) for guess in guesses]

    def share(worker: int) -> list[SearchState]:
        return [workers[worker].start(guess, bound) for guess in guesses[worker::count]]

    with ThreadPoolExecutor(count) as pool:
        shares = list(pool.map(share, range(count)))
    return [shares[index % count][index // count] for index in range(len(guesses))]


def _end(state: SearchState, chain: Array, feasible: bool, seconds: float) -> Certified:
    return Certified(
        solution=Solution(
            x=state.x,
            objective=state.objective,
            converged=state.status == CONVERGED,
            status=state.status,
            evaluations=state.evaluations,
        ),
        control=chain,
        feasible=feasible,
        evaluations=state.evaluations,
        rounds=state.rounds,
        seconds=seconds,
    )
