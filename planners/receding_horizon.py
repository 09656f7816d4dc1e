"""The paper's planner: optimise three segments, fly one, plan three again.

Choices the paper leaves open, each in one place: the very first guess and the derivatives
of random guesses (`planners.starts`); a solve counts when its chain is certified feasible,
whether or not the solver calls it converged; near the goal, within three shortest
segments, fewer segments are planned; the start derivative and the gate are the field's and
the limits'.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ferguson_gym import flight
from ferguson_gym.actions import REACH
from ferguson_gym.arrays import Array
from ferguson_gym.feasibility import is_feasible
from ferguson_gym.fields import Field
from ferguson_gym.limits import PAPER_LIMITS, Limits
from planners.exchange import Certified, solve_certified
from planners.interface import Decision, Plan, State, WindowReport
from planners.problem import Problem
from planners.rollout import roll_out
from planners.solvers import Slsqp, Solver
from planners.starts import RandomGuess, random_chain, shifted, straight
from planners.window import WindowSettings, final_problem, horizon_problem


@dataclass(frozen=True, slots=True, kw_only=True)
class RecedingHorizon:
    """The paper's planner, `single-start` without random starts, `multi-start` with ten.

    Raises:
        ValueError: limits that allow segments longer than an action can express.

    Reference:
        The paper, section III.
    """

    random_starts: int = 10
    """Random feasible guesses beside the shifted plan, for each window."""
    draws: int = 10
    """Most draws for each of them; a start that stays infeasible is left out."""
    random_guess: RandomGuess = random_chain
    """How a random guess is drawn."""
    solver: Solver = field(default_factory=Slsqp)
    settings: WindowSettings = field(default_factory=WindowSettings)
    limits: Limits = PAPER_LIMITS

    def __post_init__(self) -> None:
        if self.limits.longest + self.limits.tolerance > REACH:
            raise ValueError(
                f"an action reaches {REACH} m, too short for limits.longest = "
                f"{self.limits.longest} m"
            )

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal. Randomness of a step comes from (seed, step)."""
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it."""
        began = time.perf_counter()
        if (rest := self._rest(field, state)) is not None:
            return Decision(rest, _report(state, "planned", None, [], time.perf_counter() - began))
        vehicle = state.vehicle
        segments = self._segments(field, vehicle)
        problem = horizon_problem(field, vehicle, self.limits, self.settings, segments)
        solved: list[tuple[str, Certified]] = []
        for name, guess in self._guesses(problem, state, seed):
            end = solve_certified(
                self.solver, problem, problem.chain.unknowns(guess), field, self.limits
            )
            solved.append((name, end))
        # sorting is stable: the first of equal chains wins, as in the paper
        ranked = sorted(
            ((name, end) for name, end in solved if end.feasible),
            key=lambda pair: pair[1].solution.objective,
        )
        for name, kept in ranked:
            final = self._finish(field, state, kept.control)
            kept = final or kept
            if not flight.follow(field, vehicle, kept.control[0], self.limits).flown:
                continue
            seconds = time.perf_counter() - began
            return Decision(kept.control, _report(state, name, kept, solved, seconds, final))
        seconds = time.perf_counter() - began
        return Decision(None, _report(state, "", None, solved, seconds))

    def _segments(self, field: Field, vehicle: flight.State) -> int:
        """Segments in a window: three, fewer if even the shortest would overshoot the goal."""
        distance = float(np.linalg.norm(field.goal - vehicle.position))
        fit = max(1, int(distance / self.limits.shortest))
        return min(self.settings.segments, fit)

    def _guesses(self, problem: Problem, state: State, seed: int) -> Iterator[tuple[str, Array]]:
        """The shifted plan (at first a straight line), then random feasible chains."""
        vehicle, segments = state.vehicle, problem.chain.segments
        if len(state.tail):
            yield "shifted", shifted(vehicle, state.tail, segments)
        else:
            yield "straight", straight(vehicle, segments, self.limits)
        stream = np.random.default_rng([seed, vehicle.segments])
        low, high = problem.bounds
        for start in range(1, self.random_starts + 1):
            for _ in range(self.draws):
                guess = self.random_guess(stream, vehicle, segments, self.limits)
                x = problem.chain.unknowns(guess)
                if (low <= x).all() and (x <= high).all() and problem.c(x).min() >= 0.0:
                    yield f"random {start}", guess
                    break

    def _finish(self, field: Field, state: State, chain: Array) -> Certified | None:
        """The chain re-optimised to end on the goal, if its end is within the gate."""
        if np.linalg.norm(chain[-1, 1] - field.goal) > self.limits.gate:
            return None
        problem = final_problem(field, state.vehicle, self.limits, self.settings, len(chain))
        guess = problem.chain.unknowns(chain)
        final = solve_certified(self.solver, problem, guess, field, self.limits)
        if not final.feasible:
            return None
        step = flight.follow(field, state.vehicle, final.control[0], self.limits)
        return final if step.flown else None

    def _rest(self, field: Field, state: State) -> Array | None:
        """The plan's rest if it ends on the goal and is feasible from the state flown."""
        if len(state.tail) == 0 or not np.array_equal(state.tail[-1, 1], field.goal):
            return None
        chain = shifted(state.vehicle, state.tail, len(state.tail))
        # the tolerance covers the rounding of the segment flown last
        if not is_feasible(chain, field, self.limits).all():
            return None
        return chain if flight.follow(field, state.vehicle, chain[0], self.limits).flown else None


def _report(
    state: State,
    start: str,
    kept: Certified | None,
    solved: list[tuple[str, Certified]],
    seconds: float,
    final: Certified | None = None,
) -> WindowReport:
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
        seconds=seconds,
    )
