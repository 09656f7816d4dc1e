"""Receding horizon of convex programs: decisions whose computing time has a bound.

The window is a chain of segments around a nominal one: the rest of the last plan, extended along
the exact shortest path, or even segments along that path at the start and where the plan has become
long. Quadratic programs (`planners.optimization.convex`) make it as short as half-planes that turn
around the obstacles allow, with the exact distance to go from its end. The first segment of the
best certified window is flown. Where none is certified, finer segments are tried, then the rest of
the last plan is flown, as it is once that ends on the goal.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Step
from planners.interface import Decision, Knowledge, State, WindowReport
from planners.optimization.convex import (
    ChainSolver,
    Effort,
    Found,
    detour,
    extended_plan,
    nominal_chain,
)
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep, ends_on_goal, remaining_plan

_PART = 2.5
"""Length of the parts of an extended plan's segments [m]."""


class Grain(NamedTuple):
    """How finely a window follows its path."""

    stride: float
    """Length of a nominal segment [m]."""
    parts: int
    """Parts of a segment, each with a half-plane for each obstacle near it."""


WINDOW, PLANNED = "convex", "planned"
"""Names of choices: a certified window, and the rest of the last plan."""


class Choice(NamedTuple):
    """What a decision leads to."""

    start: str
    """WINDOW or PLANNED; empty without segments."""
    chain: Array | None
    """Segments (n, 4, 2)."""
    step: Step | None
    """The first one as flown."""
    effort: Effort
    objective: float = math.nan
    """Of the window [m]."""
    final: bool = False
    """Whether the window ends on the goal."""

    @classmethod
    def of(cls, found: Found, effort: Effort) -> Choice:
        """A certified window."""
        return cls(WINDOW, found.control, found.step, effort, found.objective, found.final)

    def decision(self, state: State, began: float) -> Decision:
        """With a report, for a decision that began at a time of `time.perf_counter` [s]."""
        report = WindowReport(
            step=state.vehicle.segments,
            start=self.start,
            objective=self.objective,
            starts=self.effort.programs,
            feasible=int(self.start == WINDOW),
            final=self.final,
            evaluations=self.effort.iterations,
            rounds=self.effort.programs,
            seconds=time.perf_counter() - began,
        )
        return Decision(self.chain, report, first_step=self.step)


@dataclass(frozen=True, slots=True, kw_only=True)
class Convex(StepByStep):
    """A receding horizon of at most `programs` quadratic programs a decision.

    Lengths are those of fields of the paper's scale, see `planners.rescaling`.
    """

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD

    segments: int = 4
    """Segments of a window."""
    grains: tuple[Grain, ...] = (Grain(7.0, 3), Grain(11.0, 4))
    """Of windows along the shortest path, the best of which is taken."""
    finer: tuple[Grain, ...] = (Grain(5.0, 4), Grain(3.6, 4))
    """Tried in turn where those lead to no certified window."""
    close: float = 3e-4
    """Excess of a window around the last plan, relative to its length, that needs no other."""
    solver: ChainSolver = field(default_factory=ChainSolver)

    @property
    def programs(self) -> int:
        """Maximum number of programs of a decision."""
        return 1 + (len(self.grains) + len(self.finer)) * self.solver.rounds

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and the rest of its window; the seed has no effect.

        Raises:
            TypeError: obstacles that are not in the plane.
        """
        began = time.perf_counter()
        return self.choose(field, state).decision(state, began)

    def choose(self, field: Field, state: State) -> Choice:
        """The segments to fly from a state, and what that took.

        Args:
            field: of the paper's scale.
            state: where they begin, with the rest of the last plan.
        """
        rest = remaining_plan(field, state) if ends_on_goal(field, state) else None
        found, effort = (None, Effort()) if rest else self.window(field, state)
        if found is not None:
            return Choice.of(found, effort)
        if rest := rest or remaining_plan(field, state):
            return Choice(PLANNED, *rest, effort)
        return Choice("", None, None, effort)

    def window(self, field: Field, state: State) -> tuple[Found | None, Effort]:
        """The best certified window from a state, if there is one, and what it took.

        Args:
            field: of the paper's scale.
            state: where the window begins, with the rest of the last plan.
        """
        best, effort = self._around_plan(field, state)
        if best is not None and best.excess <= self.close * best.length:
            return best, effort
        vehicle = state.vehicle
        for grain in self.grains + self.finer:
            if best is not None and grain in self.finer:
                break
            nominal = nominal_chain(field, vehicle, grain.stride, self.segments)
            if nominal is None:
                break
            if nominal.route < field.limits.shortest:
                return best or detour(field, vehicle), effort
            found, effort = self.solver.solve(field, vehicle, nominal, grain.parts, effort)
            if found is not None and (best is None or found.excess < best.excess):
                best = found
        return best, effort

    def _around_plan(self, field: Field, state: State) -> tuple[Found | None, Effort]:
        """The window around the rest of the last plan, by one program."""
        tail, stride = state.tail[: self.segments - 1], self.grains[0].stride
        if len(tail) == 0:
            return None, Effort()
        nominal = extended_plan(field, state.vehicle, tail, stride, self.segments)
        if nominal is None:
            return None, Effort()
        chords = np.linalg.norm(nominal.control[:, 1] - nominal.control[:, 0], axis=1)
        parts = math.ceil(chords.max() / _PART)
        once = replace(self.solver, rounds=1)
        return once.solve(field, state.vehicle, nominal, parts)
