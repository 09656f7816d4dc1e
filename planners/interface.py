"""The contract of planners: what they are given, what they return, what they promise.

A planner maps a field, a state and a seed to a `Plan`. A `Replanner` also makes a single `Decision`
from any state. A `Router` finds a `Route`, within a budget of iterations, evaluations or seconds;
`WholePath` fits segments to it. The docstring of `Planner` states the contract, and
`planners.contract` checks it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.path import Path
from ferguson_gym.runtime.arrays import Array, truncate_repr
from ferguson_gym.svg.motion import Timeline
from ferguson_gym.svg.notebook import ShowsPicture
from ferguson_gym.svg.picture import Picture
from ferguson_gym.world import Field, Inspection, Outcome, transition


class Status(Enum):
    """How planning ended."""

    SOLVED = ("solved", "found a feasible path to the goal", Outcome.GOAL_REACHED)
    STUCK = ("stuck", "found no feasible chain from the current state", Outcome.GAVE_UP)
    OUT_OF_SEGMENTS = ("out_of_segments", Outcome.OUT_OF_SEGMENTS.sentence, Outcome.OUT_OF_SEGMENTS)
    NO_ROUTE = ("no_route", "found no route to the goal", Outcome.GAVE_UP)
    NOT_FITTED = (
        "not_fitted",
        "found a route to the goal, but no feasible chain of segments along it",
        Outcome.GAVE_UP,
    )
    NO_WAY = ("no_way", "no way to the goal exists", Outcome.GAVE_UP)
    TOO_FAR = ("too_far", "the limits allow no path to the goal", Outcome.OUT_OF_SEGMENTS)
    OUT_OF_TIME = ("out_of_time", "ran out of time before the goal", Outcome.GAVE_UP)
    CRASHED = ("crashed", "the library behind the planner crashed or timed out", Outcome.GAVE_UP)

    def __init__(self, label: str, sentence: str, outcome: Outcome) -> None:
        self.label = label
        """Stable name, for files."""
        self.sentence = sentence
        """Description for people."""
        self.outcome = outcome
        """How the planned flight ends in the environment."""


class Knowledge(Enum):
    """What a planner or a policy knows of the obstacles of a field.

    A policy that uses what follows from all obstacles, such as the exact distance to go, knows the
    whole field. Both kinds know the bounds, the goal and the state of the vehicle. Obstacles that
    were within the range earlier in a flight may be remembered.
    """

    WHOLE_FIELD = ("whole field", "knows all obstacles from the start")
    NEARBY = ("nearby", "sees obstacles only within a range of the vehicle")

    def __init__(self, label: str, sentence: str) -> None:
        self.label = label
        """Stable name, for files and tables."""
        self.sentence = sentence
        """Description for people, whose subject is the policy."""


def knowledge_of(*parts: object) -> Knowledge:
    """What planners or policies that decide together know: nearby only if each knows no more.

    Each states it as its attribute `knows`. One without this attribute is given the whole field and
    counts as knowing it.

    Raises:
        ValueError: an attribute `knows` that is not a `Knowledge`.
    """
    stated = [getattr(part, "knows", Knowledge.WHOLE_FIELD) for part in parts]
    for part, knows in zip(parts, stated, strict=True):
        if not isinstance(knows, Knowledge):
            raise ValueError(
                f"the attribute knows of a {type(part).__name__} must be Knowledge.WHOLE_FIELD or "
                f"Knowledge.NEARBY of planners.interface, got {truncate_repr(knows)}"
            )
    return Knowledge.WHOLE_FIELD if Knowledge.WHOLE_FIELD in stated else Knowledge.NEARBY


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The state of a flight, and the part of a plan that is still to be flown."""

    vehicle: transition.State
    tail: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    """Segments (m, 4, 2) planned and not flown yet; empty at the start."""
    flown: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    """Segments (k, 4, 2) flown so far, the only history that a planner may use; incomplete if
    planning started in mid-flight."""


def initial_state(field: Field) -> State:
    """The state at the start of a field, with nothing planned.

    Raises:
        ValueError: a field that is not planar.
    """
    return State(transition.initial_state(field))


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowReport:
    """Statistics of one decision; planners that solve no window leave the defaults."""

    step: int
    """Number of segments flown before the decision."""
    start: str = ""
    """Name of the initial guess that led to the chosen chain; empty if no chain was found."""
    objective: float = math.nan
    """Objective of the chosen chain [m]; NaN without one."""
    starts: int = 0
    """Number of initial guesses that the solver was started from."""
    feasible: int = 0
    """How many of them led to a certified chain."""
    final: bool = False
    """Whether the chain was re-optimised to end on the goal; the objective is then its length."""
    evaluations: int = 0
    """Evaluations of the objective, over all initial guesses and the re-optimisation."""
    rounds: int = 0
    """Number of times that the chosen chain's problem was solved until the solution was
    certified."""
    solver_status: str = ""
    """The solver's message about the chosen chain."""
    cut_short: bool = False
    """Whether the deadline passed before the search was complete."""
    seconds: float
    """Time to decide, certification included."""


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """The segments that a planner would fly from a state."""

    chain: Array | None
    """Segments (n, 4, 2), certified; the first is flown next. None if none was found."""
    report: WindowReport
    candidates: Sequence[tuple[str, Array]] = ()
    """Initial guesses (n, 4, 2) of the search, by name; the chosen chain started from the last
    guess with the name `report.start`. Empty for planners that solve no window."""
    known: Field | None = None
    """The field with the obstacles that were known to the planner; None if it used the whole
    field."""
    first_step: transition.Step | None = None
    """The first segment as it is flown, with its certificate in the planner's field. A rollout
    reuses it; None makes the rollout certify."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Route:
    """A curve from the vehicle to the goal, clear of obstacles and inside the bounds."""

    points: Array
    """(n, 2) corners, or points on the curve, from the vehicle to the goal [m]."""
    length: float
    """Length of the curve itself [m]; chords between its points are shorter."""
    progress: Sequence[tuple[float, float]]
    """Each improvement of the search: seconds since planning began, and the length [m] reached."""
    evaluations: int = 0
    """Evaluations of an objective, for planners that have one."""


@dataclass(frozen=True, slots=True, eq=False)
class Plan(ShowsPicture):
    """A planned flight. A plan whose status is solved is certified feasible."""

    status: Status
    control: Array
    """Segments (n, 4, 2), rounded as they will be flown; after a failure, the segments before
    it."""
    states: Sequence[State]
    """The n + 1 states before, between and after the segments. Planning from `states[k]` gives
    the rest of this plan."""
    decisions: Sequence[Decision]
    """One for each segment, and the failed one after a failure; a single one from planners of
    whole paths. After a deadline, the last one decided all segments that follow it."""
    route: Route | None = None
    """The route of a planner of whole paths, before segments were fitted to it."""
    reason: str = ""
    """Details of a failure, empty if there are none."""
    certificates: Sequence[Inspection] | None = None
    """One for each segment as flown, from the planner's own certification; None if it did not
    keep them."""
    field: Field | None = None
    """The field that was planned in, for pictures; None if the planner did not keep it."""

    @property
    def success(self) -> bool:
        """Whether the path is feasible and ends on the goal."""
        return self.status is Status.SOLVED

    @property
    def path(self) -> Path | None:
        """The path to the goal; None after a failure, or if planning began on the goal."""
        return Path(self.control) if self.success and len(self.control) else None

    def picture(self) -> Picture:
        """A picture of the plan in its field, with the route that segments were fitted to.

        Raises:
            ValueError: neither a field nor segments to draw.
        """
        picture = self._region()
        picture.add_chain(self.control)
        return picture

    def animate(self, seconds: float = 5.0) -> Picture:
        """An animated picture of a vehicle that flies the plan in some seconds.

        Raises:
            ValueError: neither a field nor segments to draw, or no positive and finite number of
                seconds.
        """
        picture = self._region()
        picture.add_motion(self.control, Timeline(length(self.control), seconds))
        return picture

    def _region(self) -> Picture:
        """A picture of what surrounds the plan."""
        if self.field is None and len(self.control) == 0:
            raise ValueError("the plan has neither a field nor segments to draw")
        picture = Path(self.control).region() if self.field is None else self.field.picture()
        metres = float(length(self.control).sum())
        number = len(self.control)
        where = "" if self.field is None else f"{self.field.name}: "
        segments = f"{number} segment{'s' * (number != 1)}"
        picture.caption = f"{where}{segments}, {metres:.2f} m, {self.status.sentence}"
        if self.route is not None:
            picture.add_route(self.route.points)
        return picture

    @property
    def step_seconds(self) -> list[float]:
        """Time to decide each segment, certification included [s]."""
        return [decision.report.seconds for decision in self.decisions]

    @property
    def evaluations(self) -> int:
        """Evaluations of the objective in the whole flight."""
        return sum(decision.report.evaluations for decision in self.decisions)


class Planner(Protocol):
    """Plans whole flights.

    The contract; `planners.contract.check_planner` tests most of it:

    - The first segment starts at the vehicle's position with the vehicle's derivative, each further
      one with the end point and end derivative of the segment before it. Every segment is feasible.
      A solved plan ends on the goal; another status, or a decision without a chain, reports a
      failure.
    - `Plan.control` has the segments as they are flown: rounded to float32 actions and certified
      after the rounding. `planners.rollout.roll_out` and `fly_chain` return such segments.
    - The first segment that `decide` chooses is, as it is flown, the first of the plan.
    - Random numbers depend only on (seed, step), step being the number of segments flown. The same
      arguments give the same plan, and planning from `Plan.states[k]` gives the rest of the plan.
    - Planning works from any state: without a flown path, with a vehicle at rest, on the goal (the
      plan is then solved and empty), or after the last segment that the field's limits allow.
    - Planning changes neither the field nor the state.

    A planner that uses only obstacles near the vehicle, although it is given all of them, may state
    so: `knows = Knowledge.NEARBY` in its class. Tables that compare planners show it.
    """

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from any state to the goal, as the contract says."""


@runtime_checkable
class Replanner(Planner, Protocol):
    """A planner that decides one segment at a time, from the state that was reached."""

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones."""


class Router(Protocol):
    """Finds routes."""

    def route(self, field: Field, vehicle: transition.State, seed: int) -> Route | None:
        """Find a route from a vehicle to the goal; None if the search fails.

        Raises:
            CrashedError: the library behind the router crashed or did not answer.
        """


class CrashedError(RuntimeError):
    """The library behind a planner crashed or did not answer; the planner remains usable."""


@dataclass(frozen=True, slots=True)
class _Count:
    """A budget that gives the same path on every machine.

    Raises:
        ValueError: a count below 1.
    """

    unit: ClassVar[str]
    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"a budget is at least 1 {self.unit}, got {self.count}")


class Iterations(_Count):
    """A number of iterations of a search."""

    unit = "iteration"


class Evaluations(_Count):
    """A number of evaluations of an objective."""

    unit = "evaluation"


@dataclass(frozen=True, slots=True)
class Seconds:
    """A budget of wall-clock time: the path depends on the machine.

    Raises:
        ValueError: a time that is not positive and finite.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < math.inf:
            raise ValueError(f"a budget is a number of seconds above 0, got {self.seconds}")
