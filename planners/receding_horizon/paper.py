"""`RecedingHorizon`, the paper's planner: `single-start` and `multi-start`.

The paper leaves some choices open. Here they are:

- `planners.optimization.initial_guesses` has the initial guess of the first window and the
  derivatives of random guesses.
- A solution is accepted if its chain is certified feasible, even if the solver did not converge.
- Within three shortest segments of the goal, fewer segments are planned.
- The start derivative comes from the field, and the gate from the limits.

Reference:
    The paper, section III.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, transition
from planners.interface import Decision, Knowledge, State, WindowReport, knowledge_of
from planners.optimization import FirstGuess, MultiStart, Proposer, RandomGuess
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.initial_guesses import random_chains, shifted, shifted_or_straight
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep, ends_on_goal, remaining_plan


@dataclass(frozen=True, slots=True, kw_only=True)
class RecedingHorizon(StepByStep):
    """The paper's planner: `single-start` without random starts, `multi-start` with ten."""

    first_guess: FirstGuess = shifted_or_straight
    """Initial guesses of a window, before the random ones."""
    random_starts: int = 10
    """Number of random feasible guesses for each window."""
    draws: int = 10
    """Maximum number of draws per random guess; if none is feasible, the guess is omitted."""
    redraws: tuple[int, ...] = (10, 100)
    """If no guess leads to a chain, drawing is repeated with `draws` times these factors."""
    random_guess: RandomGuess = random_chains
    """Draws random guesses."""
    proposer: Proposer | None = None
    """Proposes initial guesses. The solver starts from these alone at first, since chains from
    other guesses might have a lower objective although the proposed route is better globally. If
    the proposals fail, the shifted plan and the random guesses follow. Without a deadline, a
    proposer therefore never costs a solution."""
    polish: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    """Solves windows from proposals."""
    solver: WindowSolver = field(default_factory=MultiStart)
    settings: WindowSettings = field(default_factory=WindowSettings)
    deadline: float = math.inf
    """Time for a decision [s]. Once it has passed, the best certified chain found so far is flown,
    or the rest of the last plan; results then depend on the machine."""

    @property
    def knows(self) -> Knowledge:
        """Obstacles at most 45 m away, or three longest segments, unless a proposer knows more."""
        return Knowledge.NEARBY if self.proposer is None else knowledge_of(self.proposer)

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones."""
        search = _Search(state, self.deadline)
        if ends_on_goal(field, state) and (resumed := self._resume(field, search)):
            return resumed
        proposed = self._proposed(field, state.vehicle, seed)
        return (
            self._arrive(field, search, proposed)
            or self._advance(field, search, proposed, seed)
            or search.decision(None)
        )

    def _resume(self, field: Field, search: _Search) -> Decision | None:
        """Fly the rest of the last plan, if it is still feasible."""
        rest = remaining_plan(field, search.state)
        return None if rest is None else search.decision(*rest, start="planned")

    def _arrive(
        self, field: Field, search: _Search, proposed: Sequence[tuple[str, Array]]
    ) -> Decision | None:
        """Fly the first proposal that ends on the goal and leads to a feasible chain."""
        for name, guess in proposed:
            if np.array_equal(guess[-1, 1], field.goal):
                end = self._final(field, search, guess, self.polish)
                search.add([(name, guess)], [end])
                if (step := self._fly(field, search, end)) is not None:
                    return search.decision(end.control, step, start=name, chosen=end, final=True)
        return None

    def _advance(
        self, field: Field, search: _Search, proposed: Sequence[tuple[str, Array]], seed: int
    ) -> Decision | None:
        """Fly the best chain of the first round of guesses that leads to a feasible one.

        After the deadline, the rest of the last plan is flown instead.
        """
        window = self.window(field, search.state.vehicle)
        for solver, starts in self._rounds(window, search.state, seed, proposed):
            search.add(starts, solver.solve(window, [guess for _, guess in starts], search.until))
            for name, end in search.ranked():
                if (decision := self._commit(field, search, name, end, solver)) is not None:
                    return decision
            if time.perf_counter() > search.until:
                return self._resume(field, search)
        return None

    def _commit(
        self, field: Field, search: _Search, name: str, end: Certified, solver: WindowSolver
    ) -> Decision | None:
        """Fly a certified chain, re-optimised to end on the goal if its end is within the gate."""
        if np.linalg.norm(end.control[-1, 1] - field.goal) <= field.limits.gate:
            final = self._final(field, search, end.control, solver)
            if (step := self._fly(field, search, final)) is not None:
                search.evaluations += final.evaluations
                return search.decision(final.control, step, start=name, chosen=final, final=True)
        step = self._fly(field, search, end)
        return None if step is None else search.decision(end.control, step, name, end)

    def window(self, field: Field, vehicle: transition.State) -> Window:
        """The next window: three segments, or fewer where three would overshoot the goal."""
        distance = float(np.linalg.norm(field.goal - vehicle.position))
        fit = max(1, int(distance / field.limits.shortest))
        segments = min(self.settings.segments, fit)
        return horizon_window(field, vehicle, self.settings, segments)

    def _proposed(
        self, field: Field, vehicle: transition.State, seed: int
    ) -> list[tuple[str, Array]]:
        """The proposer's chains by name; empty without a proposer."""
        if self.proposer is None:
            return []
        chains = self.proposer.propose(field, vehicle, self.settings.segments, seed)
        return [(f"proposal {rank}", chain) for rank, chain in enumerate(chains, start=1)]

    def _rounds(
        self, window: Window, state: State, seed: int, proposed: Sequence[tuple[str, Array]]
    ) -> Iterator[tuple[WindowSolver, list[tuple[str, Array]]]]:
        """Rounds of guesses by name, each with its solver; a round is used if all before failed."""
        if proposed:
            segments = window.chain.segments
            fitted = [(name, shifted(state.vehicle, guess, segments)) for name, guess in proposed]
            yield self.polish, fitted
        for starts in self.starts(window, state, seed):
            if starts:
                yield self.solver, starts

    def starts(self, window: Window, state: State, seed: int) -> Iterator[list[tuple[str, Array]]]:
        """Rounds of guesses by name: `first_guess` with random feasible chains, then random ones.

        Each round of random chains has more draws than the last.
        """
        vehicle, segments = state.vehicle, window.chain.segments
        first = self.first_guess(vehicle, state.tail, segments, window.field.limits)
        if self.random_starts == 0:
            yield [*first]
            return
        stream = np.random.default_rng([seed, vehicle.segments])
        yield [*first, *self._drawn(window, vehicle, stream, self.draws)]
        for factor in self.redraws:
            yield self._drawn(window, vehicle, stream, factor * self.draws)

    def _drawn(
        self, window: Window, vehicle: transition.State, stream: np.random.Generator, draws: int
    ) -> list[tuple[str, Array]]:
        """For each random start the first feasible one of its draws, if any is feasible."""
        count = self.random_starts * draws
        limits, segments = window.field.limits, window.chain.segments
        drawn = self.random_guess(stream, vehicle, segments, limits, count)
        admitted = window.admits(drawn).reshape(self.random_starts, draws)
        return [
            # copied, so that a stored decision does not keep the whole array of draws alive
            (f"random {start + 1}", drawn[start * draws + admitted[start].argmax()].copy())
            for start in np.flatnonzero(admitted.any(axis=1))
        ]

    def _final(
        self, field: Field, search: _Search, guess: Array, solver: WindowSolver
    ) -> Certified:
        """The shortest chain to the goal found from a guess (n, 4, 2), of as many segments."""
        vehicle = search.state.vehicle
        window = final_window(field, vehicle, self.settings, len(guess))
        (final,) = solver.solve(window, [guess], search.until)
        return final

    def _fly(self, field: Field, search: _Search, end: Certified) -> transition.Step | None:
        """The first segment as flown, certified since rounding changes it; None if it fails."""
        if not end.feasible:
            return None
        step = transition.fly_segment(field, search.state.vehicle, end.control[0])
        return step if step.flown else None


class _Search:
    """The searches of one decision."""

    def __init__(self, state: State, deadline: float) -> None:
        self.state = state
        self.began = time.perf_counter()
        self.until = self.began + deadline
        self.guesses: list[tuple[str, Array]] = []
        self.ends: list[tuple[str, Certified]] = []
        self.evaluations = 0

    def add(self, starts: Sequence[tuple[str, Array]], ends: Sequence[Certified]) -> None:
        """Record searches from guesses by name; after a deadline there are fewer results."""
        self.guesses += starts[: len(ends)]
        self.ends += [(name, end) for (name, _), end in zip(starts, ends, strict=False)]
        self.evaluations += sum(end.evaluations for end in ends)

    def ranked(self) -> list[tuple[str, Certified]]:
        """Certified results, the best objective first; ties go to the first, as in the paper."""
        certified = [(name, end) for name, end in self.ends if end.feasible]
        return sorted(certified, key=lambda pair: pair[1].solution.objective)

    def decision(
        self,
        chain: Array | None,
        step: transition.Step | None = None,
        start: str = "",
        chosen: Certified | None = None,
        final: bool = False,
    ) -> Decision:
        """The decision for a chain (n, 4, 2), with a report on all searches."""
        now = time.perf_counter()
        report = WindowReport(
            step=self.state.vehicle.segments,
            start=start,
            objective=math.nan if chosen is None else chosen.solution.objective,
            starts=len(self.ends),
            feasible=sum(end.feasible for _, end in self.ends),
            final=final,
            evaluations=self.evaluations,
            rounds=0 if chosen is None else chosen.rounds,
            solver_status="" if chosen is None else chosen.solution.status,
            cut_short=bool(self.ends) and now > self.until,
            seconds=now - self.began,
        )
        return Decision(chain, report, self.guesses, first_step=step)
