"""The paper's planner: optimise three segments, fly one, plan three again.

Choices the paper leaves open, each in one place: the very first guess and the derivatives
of random guesses (`planners.optimization.initial_guesses`); a solve counts when its chain is
certified feasible, whether or not the solver calls it converged; near the goal, within three
shortest segments, fewer segments are planned; the start derivative and the gate are the field's and
the limits'.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.actions import REACH
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from planners.interface import Decision, Plan, State, WindowReport
from planners.optimization.certification import Certified, WindowSolver
from planners.optimization.initial_guesses import (
    FirstGuess,
    Proposer,
    RandomGuess,
    as_planned,
    random_chains,
    shifted,
)
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window
from planners.rollout import arriving, rest, roll_out


@dataclass(frozen=True, slots=True, kw_only=True)
class RecedingHorizon:
    """The paper's planner, `single-start` without random starts, `multi-start` with ten.

    Raises:
        ValueError: limits that allow segments longer than an action can express, where they are
            flown as actions.

    Reference:
        The paper, section III.
    """

    first_guess: FirstGuess = as_planned
    """What a window is searched from before all random guesses: the shifted plan."""
    random_starts: int = 10
    """Random feasible guesses beside it, for each window."""
    draws: int = 10
    """Most draws for each of them; a start that stays infeasible is left out."""
    redraws: tuple[int, ...] = (10, 100)
    """How many times as many draws random guesses get where all starts led to nothing, in turn."""
    random_guess: RandomGuess = random_chains
    """How a random guess is drawn."""
    proposer: Proposer | None = None
    """Proposes starts. They are searched first and alone: who proposes knows more of the way than
    the objective, by which other starts would win. The shifted plan and the random starts follow
    where that leads to nothing, so that a way on is found wherever it would be without."""
    polish: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    """Searches from proposals."""
    solver: WindowSolver = field(default_factory=MultiStart)
    settings: WindowSettings = field(default_factory=WindowSettings)
    limits: Limits = PAPER_LIMITS
    follow: transition.Follow = transition.fly_segment
    """How segments are flown: as the environment's actions, `flight.follow_exactly` without."""
    deadline: float = math.inf
    """Time [s] for a decision. When it has passed, the best certified chain found so far is
    flown, or what is left of the last; results then depend on the machine."""

    def __post_init__(self) -> None:
        reach = REACH if self.follow is transition.fly_segment else math.inf
        if self.limits.longest + self.limits.tolerance > reach:
            raise ValueError(
                f"an action reaches {reach} m, too short for limits.longest = "
                f"{self.limits.longest} m; flight.follow_exactly flies segments without actions"
            )

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal. Randomness of a step comes from (seed, step)."""
        return roll_out(self, field, state, seed, self.follow)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it."""
        began = time.perf_counter()
        until = began + self.deadline
        if arriving(field, state) and (left := self._rest(field, state)) is not None:
            return Decision(left, _report(state, "planned", None, [], began))
        vehicle = state.vehicle
        window = self.window(field, vehicle)
        begun: list[tuple[str, Array]] = []
        solved: list[tuple[str, Certified]] = []
        proposed = self._proposed(field, vehicle, seed)
        for name, guess in proposed:
            if np.array_equal(guess[-1, 1], field.goal):
                arrival = self._final(field, vehicle, guess, self.polish, until)
                begun.append((name, guess))
                solved.append((name, arrival))
                if self._flies(field, vehicle, arrival):
                    report = _report(state, name, arrival, solved, began, until)
                    return Decision(arrival.control, replace(report, final=True), begun)
        for solver, starts in self._rounds(window, state, seed, proposed):
            names, guesses = zip(*starts, strict=True)
            ends = solver.solve(window, guesses, until)
            solved += zip(names, ends, strict=False)
            begun += starts[: len(ends)]
            # sorting is stable: the first of equal chains wins, as in the paper
            ranked = sorted(
                ((name, end) for name, end in solved if end.feasible),
                key=lambda pair: pair[1].solution.objective,
            )
            for name, kept in ranked:
                final = self._finish(field, vehicle, kept.control, solver, until)
                kept = final or kept
                if self._flies(field, vehicle, kept):
                    report = _report(state, name, kept, solved, began, until, final)
                    return Decision(kept.control, report, begun)
            if time.perf_counter() > until:
                if (left := self._rest(field, state)) is not None:
                    report = _report(state, "planned", None, solved, began, until)
                    return Decision(left, report, begun)
                break
        return Decision(None, _report(state, "", None, solved, began, until), begun)

    def window(self, field: Field, vehicle: transition.State) -> Window:
        """What is planned next: three segments, fewer if even the shortest would overshoot."""
        distance = float(np.linalg.norm(field.goal - vehicle.position))
        fit = max(1, int(distance / self.limits.shortest))
        segments = min(self.settings.segments, fit)
        return horizon_window(field, vehicle, self.limits, self.settings, segments)

    def _proposed(
        self, field: Field, vehicle: transition.State, seed: int
    ) -> list[tuple[str, Array]]:
        """What the proposer proposes, if there is one, by name."""
        if self.proposer is None:
            return []
        chains = self.proposer.propose(field, vehicle, self.settings.segments, seed)
        return [(f"proposal {rank}", chain) for rank, chain in enumerate(chains, start=1)]

    def _rounds(
        self, window: Window, state: State, seed: int, proposed: Sequence[tuple[str, Array]]
    ) -> Iterator[tuple[WindowSolver, list[tuple[str, Array]]]]:
        """Starts by name, and what searches from them; the next where the last led to nothing."""
        if proposed:
            segments = window.chain.segments
            fitted = [(name, shifted(state.vehicle, guess, segments)) for name, guess in proposed]
            yield self.polish, fitted
        for starts in self.starts(window, state, seed):
            if starts:
                yield self.solver, starts

    def starts(self, window: Window, state: State, seed: int) -> Iterator[list[tuple[str, Array]]]:
        """The first guess, the shifted plan, and random feasible chains, by name.

        Where they lead to nothing, random chains again, drawn more often.
        """
        vehicle, segments = state.vehicle, window.chain.segments
        first = self.first_guess(vehicle, state.tail, segments, self.limits)
        if self.random_starts == 0:
            yield [*first]
            return
        stream = np.random.default_rng([seed, vehicle.segments])
        yield [*first, *self._drawn(window, vehicle, stream, self.draws)]
        for often in self.redraws:
            yield self._drawn(window, vehicle, stream, often * self.draws)

    def _drawn(
        self, window: Window, vehicle: transition.State, stream: np.random.Generator, draws: int
    ) -> list[tuple[str, Array]]:
        """The first feasible chain of some draws, for each random start that has one."""
        count = self.random_starts * draws
        drawn = self.random_guess(stream, vehicle, window.chain.segments, self.limits, count)
        admitted = window.admits(drawn).reshape(self.random_starts, draws)
        return [
            # a copy: decisions are kept, and would keep all that was drawn
            (f"random {start + 1}", drawn[start * draws + admitted[start].argmax()].copy())
            for start in np.flatnonzero(admitted.any(axis=1))
        ]

    def _finish(
        self,
        field: Field,
        vehicle: transition.State,
        chain: Array,
        solver: WindowSolver,
        until: float,
    ) -> Certified | None:
        """The chain re-optimised to end on the goal, if its end is within the gate."""
        if np.linalg.norm(chain[-1, 1] - field.goal) > self.limits.gate:
            return None
        final = self._final(field, vehicle, chain, solver, until)
        return final if self._flies(field, vehicle, final) else None

    def _final(
        self,
        field: Field,
        vehicle: transition.State,
        guess: Array,
        solver: WindowSolver,
        until: float,
    ) -> Certified:
        """The shortest chain found to the goal, of as many segments as a guess has."""
        window = final_window(field, vehicle, self.limits, self.settings, len(guess))
        (final,) = solver.solve(window, [guess], until)
        return final

    def _flies(self, field: Field, vehicle: transition.State, end: Certified) -> bool:
        """Whether a chain is certified, and its first segment flies as an action."""
        return end.feasible and self.follow(field, vehicle, end.control[0], self.limits).flown

    def _rest(self, field: Field, state: State) -> Array | None:
        """What is left of the last plan, if it may be flown."""
        return rest(field, state, self.limits, self.follow)


def _report(
    state: State,
    start: str,
    kept: Certified | None,
    solved: list[tuple[str, Certified]],
    began: float,
    until: float = math.inf,
    final: Certified | None = None,
) -> WindowReport:
    now = time.perf_counter()
    return WindowReport(
        step=state.vehicle.segments,
        start=start,
        objective=math.nan if kept is None else kept.solution.objective,
        starts=len(solved),
        feasible=sum(end.feasible for _, end in solved),
        final=final is not None,
        evaluations=sum(end.evaluations for _, end in solved)
        + (0 if final is None else final.evaluations),
        rounds=0 if kept is None else kept.rounds,
        solver_status="" if kept is None else kept.solution.status,
        cut_short=now > until,
        seconds=now - began,
    )
