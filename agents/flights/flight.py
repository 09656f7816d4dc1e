"""Flying a policy through a field in the environment, and what is measured of the flight."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import gymnasium as gym

from agents.flights.metrics import path_share
from agents.policies import Policy, make_policy
from agents.policies.shield_decisions import ShieldDecision
from agents.policies.warm_up import warm_policy
from agents.runtime.kernels import compile_kernels
from ferguson_gym.curves import Path
from ferguson_gym.curves import length as segment_lengths
from ferguson_gym.environment import ObstacleField
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import gap, reference_length
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.svg import Picture, ShowsPicture
from ferguson_gym.svg.motion import Timeline
from ferguson_gym.world import Field, Outcome, State
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field_names import as_field
from planners.interface import Decision, Route


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Flight(ShowsPicture):
    """One flight of a policy through a field."""

    policy: str
    """The policy's name."""
    field: Field
    seed: int = 0
    """Policy seed."""
    outcome: Outcome
    control: Array
    """(n, 4, 2) segments flown [m, m per unit t]."""
    refused: Array | None
    """(4, 2) the infeasible segment that ended the flight, which was not flown, if any."""
    clearance: float
    """Minimum clearance along the segments flown [m]."""
    seconds: float = math.nan
    """Duration of the whole flight [s]; in a batch, an equal share of the batch's."""
    decision_seconds: Sequence[float] = ()
    """Time to choose each action [s]; empty in a batch, whose actions are chosen together."""
    decisions: Sequence[Decision] = ()
    """The planner's decisions; empty for policies without a planner."""
    shield_decisions: Sequence[ShieldDecision] = ()
    """Whether the agent or the planner decided each step, and why; empty without a shield."""
    route: Route | None = None
    """The route that a whole-path planner found before it fitted segments to it."""
    reference: bool = True
    """Whether the flight is compared with the field's shortest path, which takes seconds to compute
    among thousands of obstacles."""

    def picture(self) -> Picture:
        """A picture of the flight through its field, with the route and the refused segment."""
        picture = self._region()
        picture.add_chain(self.control)
        if self.refused is not None:
            picture.add_refused(self.refused)
        return picture

    def animate(self, seconds: float = 5.0) -> Picture:
        """An animated picture of the flight, which takes some seconds.

        Raises:
            ValueError: no positive and finite number of seconds.
        """
        picture = self._region()
        timeline = Timeline(segment_lengths(self.control), seconds)
        picture.add_motion(self.control, timeline)
        if self.refused is not None:
            picture.add_refused(self.refused, timeline)
        return picture

    def _region(self) -> Picture:
        """A picture of the field and the route, with the flight's caption."""
        picture = self.field.picture()
        number = len(self.control)
        segments = f"{number} segment{'s' * (number != 1)}"
        gap = "" if self.gap is None else f", gap {100.0 * self.gap:.2f} %"
        told = f"{segments}, {self.length:.2f} m{gap}, {self.outcome.sentence}"
        picture.caption = f"{self.policy} on {self.field.name}: {told}"
        if self.route is not None:
            picture.add_route(self.route.points)
        return picture

    @property
    def success(self) -> bool:
        """Whether the flight was feasible and ended on the goal."""
        return self.outcome.success

    @property
    def length(self) -> float:
        """Length flown [m]."""
        return Path(self.control).length if len(self.control) else 0.0

    @property
    def exact_length(self) -> float | None:
        """Length of the field's shortest path [m]; None without one or with other obstacles.

        It is computed when it is asked for; None also without a `reference`, and if the start lies
        within the gate of the goal.
        """
        return reference_length(self.field) if self.reference else None

    @property
    def gap(self) -> float | None:
        """Length / exact length - 1; None unless the flight succeeded."""
        exact = self.exact_length if self.success else None
        return None if exact is None else gap(self.length, exact)

    @property
    def path_share(self) -> float:
        """This flight's term in SPL, which is the mean of these terms over flights."""
        return float(path_share(self.success, self.length, self.exact_length))

    @property
    def min_turn_radius(self) -> float:
        """Smallest turn radius along the flight [m]; infinite if the path is straight."""
        return Path(self.control).min_turn_radius if len(self.control) else math.inf

    @property
    def windows(self) -> list[Array]:
        """The chains (m, 4, 2) that the planner found by search."""
        found = [one.chain for one in self.decisions if one.report.starts > 0]
        return [chain for chain in found if chain is not None]

    @property
    def evaluations(self) -> int:
        """Evaluations of the objective by the planner, over the flight."""
        return sum(decision.report.evaluations for decision in self.decisions)


class StepData(NamedTuple):
    """What the environment reported after its reset, or after one step."""

    observation: Observation
    """After the step."""
    state: State
    """The vehicle's state after the step, not rounded as observations are."""
    info: Mapping[str, Any]
    action: Action | None = None
    """(4,), None after the reset."""
    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False


def fly(
    policy: Policy | str,
    field: Field | str,
    seed: int = 0,
    *,
    name: str | None = None,
    environment: gym.Env[Observation, Action] | None = None,
    on_step: Callable[[StepData], object] | None = None,
) -> Flight:
    """Fly a policy through a field in the environment until the flight ends.

    The flight is a function of (policy, field, seed), except for its times.

    Args:
        policy: A policy, or the name of one.
        field: A planar field with discs, or the name of one.
        seed: Policy seed.
        name: What the flight calls its policy; by default the name given, or the policy's class.
        environment: An `ObstacleField`, wrapped or not; None: one with default settings.
        on_step: Called with what the environment reports, after the reset and after each step.

    Raises:
        ValueError: An unknown policy or field, an agent that cannot be loaded, or a field that is
            not planar.
        TypeError: Obstacles other than discs.
    """
    if isinstance(policy, str):
        named = make_policy(policy)  # agents are ready when they are loaded
        warm_policy(policy)
        name, policy = name or policy, named
    compile_kernels()
    field = as_field(field)
    env = ObstacleField(fields=1) if environment is None else environment
    inner: Any = env.unwrapped
    began = time.perf_counter()
    observation, info = env.reset(seed=0, options={"field": field})
    policy.begin(field, seed)
    if on_step is not None:
        on_step(StepData(observation, inner.state, info))
    outcome = Outcome.FLYING
    decision_seconds: list[float] = []
    while outcome is Outcome.FLYING:
        asked = time.perf_counter()
        action = policy.act(observation, inner.state)
        decision_seconds.append(time.perf_counter() - asked)
        if action is None:
            outcome = Outcome.GAVE_UP
            break
        observation, reward, terminated, truncated, info = env.step(action)
        outcome = Outcome.from_code(info["outcome"])
        if on_step is not None:
            step = (action, float(reward), terminated, truncated)
            on_step(StepData(observation, inner.state, info, *step))
    return Flight(
        policy=type(policy).__name__ if name is None else name,
        field=field,
        seed=seed,
        outcome=outcome,
        control=inner.control,
        refused=inner.refused,
        clearance=float(info["clearance"]),
        seconds=time.perf_counter() - began,
        decision_seconds=decision_seconds,
        decisions=list(getattr(policy, "decisions", [])),
        shield_decisions=list(getattr(policy, "shield_decisions", [])),
        route=getattr(policy, "route", None),
    )
