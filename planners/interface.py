"""What every planner takes and gives: states, decisions, plans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np

from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.outcome import Outcome


class Status(Enum):
    """How planning ended. Labels are stable: data carries them."""

    SOLVED = ("solved", "found a feasible path to the goal", Outcome.GOAL_REACHED)
    STUCK = ("stuck", "found no feasible window from where it was", Outcome.GAVE_UP)
    OUT_OF_SEGMENTS = (
        "out_of_segments",
        Outcome.OUT_OF_SEGMENTS.sentence,
        Outcome.OUT_OF_SEGMENTS,
    )

    NO_ROUTE = ("no_route", "found no way to the goal", Outcome.GAVE_UP)
    NOT_FITTED = (
        "not_fitted",
        "found a way to the goal, but no feasible chain of segments along it",
        Outcome.GAVE_UP,
    )
    CRASHED = ("crashed", "its library crashed or did not answer", Outcome.GAVE_UP)

    def __init__(self, label: str, sentence: str, outcome: Outcome) -> None:
        self.label = label
        """Stable name, as in files."""
        self.sentence = sentence
        """What people are shown."""
        self.outcome = outcome
        """How the planned flight ends in the environment."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Where a flight is, and what the planner means to fly from there."""

    vehicle: transition.State
    tail: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    """Segments (m, 4, 2) planned and not flown yet; none at the start."""
    flown: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    """Segments (k, 4, 2) flown so far, all that a planner remembers; fewer where a flight is
    taken up on its way."""


def initial_state(field: Field) -> State:
    """The state at the start of a field, with nothing planned."""
    return State(transition.initial_state(field))


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowReport:
    """How one decision came about; planners that solve nothing leave the defaults."""

    step: int
    """Segments flown before it."""
    start: str = ""
    """Which first guess led to the chain that was kept; empty if none did."""
    objective: float = math.nan
    """Objective of that chain [m]; NaN if there is none."""
    starts: int = 0
    """Guesses from which the solver was started."""
    feasible: int = 0
    """How many of them led to a certified chain."""
    final: bool = False
    """Whether the chain was then re-optimised to end on the goal; the objective is its length."""
    evaluations: int = 0
    """Evaluations of the objective, over all starts and the re-optimisation."""
    rounds: int = 0
    """Solves of the kept chain's problem until certification had nothing to add."""
    solver_status: str = ""
    """The solver's word on the kept chain."""
    cut_short: bool = False
    """Whether a deadline passed before the search was over."""
    seconds: float
    """Time to decide, certification included."""


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """What a planner would fly from a state."""

    chain: Array | None
    """Segments (n, 4, 2), certified; the first is flown next. None: no way on was found."""
    report: WindowReport
    candidates: Sequence[tuple[str, Array]] = ()
    """First guesses (n, 4, 2) that were searched from, by name; the last one of the name
    `report.start` led to the chain. None from planners that solve nothing."""
    known: Field | None = None
    """The field as far as the planner knew it; None: all of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A flight as a planner found it: what it reports as solved is certified feasible."""

    status: Status
    control: Array
    """Segments (n, 4, 2) as they will be flown; those flown so far where it failed."""
    states: Sequence[State]
    """States before each segment, and the last: n + 1. Planning from `states[k]` gives the
    rest of this plan again."""
    decisions: Sequence[Decision]
    """One for each segment, and the failed one where it failed; a single one from planners
    that plan the whole path at once."""
    route: Route | None = None
    """What planners of whole paths found before segments were fitted to it."""
    reason: str = ""
    """What is known of a crash."""

    @property
    def success(self) -> bool:
        """Whether the path is feasible and ends on the goal."""
        return self.status is Status.SOLVED

    @property
    def path(self) -> Path | None:
        """The path to the goal; None if none was found, or the flight was there before."""
        return Path(self.control) if self.success and len(self.control) else None

    @property
    def step_seconds(self) -> list[float]:
        """Time to decide each segment, certification included [s]."""
        return [decision.report.seconds for decision in self.decisions]

    @property
    def evaluations(self) -> int:
        """Evaluations of the objective in the whole flight."""
        return sum(decision.report.evaluations for decision in self.decisions)


class Planner(Protocol):
    """Field and state in, certified plan out."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal. Randomness of a step comes from (seed, step)."""


@runtime_checkable
class Replanner(Planner, Protocol):
    """A planner that decides one segment at a time, from the state that was flown."""

    @property
    def limits(self) -> Limits:
        """What a segment may be."""

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Route:
    """A way to the goal, clear of obstacles and inside the bounds."""

    points: Array
    """(n, 2) corners, or points on the curve, from the vehicle to the goal [m]."""
    length: float
    """Of the curve itself [m]; points on it may lie on shorter chords."""
    progress: Sequence[tuple[float, float]]
    """Seconds since planning began, and the length [m] that was reached: each time a shorter
    route was found, the first first."""
    evaluations: int = 0
    """Evaluations of an objective, for planners that have one."""


class Router(Protocol):
    """Finds routes."""

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """A route from a vehicle to the goal, None if none was found.

        Raises:
            CrashedError: what does the work crashed or did not answer.
        """


class CrashedError(RuntimeError):
    """A planner's library crashed or did not answer; the planner lives on."""


@dataclass(frozen=True, slots=True)
class Iterations:
    """So many rounds of the search: the same path on every machine.

    Raises:
        ValueError: fewer than one.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"a budget is at least 1 iteration, got {self.count}")


@dataclass(frozen=True, slots=True)
class Evaluations:
    """So many evaluations of an objective: the same path on every machine.

    Raises:
        ValueError: fewer than one.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"a budget is at least 1 evaluation, got {self.count}")


@dataclass(frozen=True, slots=True)
class Seconds:
    """So much time by the clock: what is found depends on the machine.

    Raises:
        ValueError: none, or endless.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < math.inf:
            raise ValueError(f"a budget is a number of seconds above 0, got {self.seconds}")
