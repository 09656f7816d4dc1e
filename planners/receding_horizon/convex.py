"""Receding horizon of convex programs: decisions whose computing time has a bound.

The exact shortest path from the vehicle names the homotopy class, and even segments on it are the
nominal window. Quadratic programs (`planners.optimization.convex`) make the window as short as
half-planes that turn around the obstacles allow, with the exact distance to go from its end. The
first segment of the best certified window is flown. Where no window is certified, finer ones are
tried, then the rest of the last plan is flown.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

from ferguson_gym.world import Field, transition
from planners.interface import Decision, Knowledge, State, WindowReport
from planners.optimization.convex import ChainSolver, Effort, Found, detour, nominal_chain
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep, remaining_plan


class Grain(NamedTuple):
    """How finely a window follows its path."""

    stride: float
    """Length of a nominal segment [m]."""
    parts: int
    """Parts of a segment, each with a half-plane for each obstacle near it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Convex(StepByStep):
    """A receding horizon of at most `len(grains) * solver.rounds` quadratic programs a decision.

    `grains` are those of fields of the paper's scale, see `planners.rescaling`.
    """

    knows: ClassVar[Knowledge] = Knowledge.WHOLE_FIELD

    segments: int = 3
    """Segments of a window."""
    grains: tuple[Grain, ...] = (Grain(6.0, 3), Grain(5.0, 5), Grain(3.6, 6))
    """Tried until one leads to a certified window."""
    solver: ChainSolver = field(default_factory=ChainSolver)

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and the rest of its window; the seed has no effect.

        Raises:
            TypeError: obstacles that are not in the plane.
        """
        began = time.perf_counter()
        vehicle = state.vehicle
        found, effort = self.window(field, vehicle)
        start = "" if found is None else f"{effort.programs} programs"
        chain, step = (None, None) if found is None else (found.control, found.step)
        if found is None and (rest := remaining_plan(field, state)) is not None:
            start, (chain, step) = "planned", rest
        report = WindowReport(
            step=vehicle.segments,
            start=start,
            starts=effort.programs,
            feasible=int(found is not None),
            evaluations=effort.iterations,
            rounds=effort.programs,
            seconds=time.perf_counter() - began,
        )
        return Decision(chain, report, first_step=step)

    def window(self, field: Field, vehicle: transition.State) -> tuple[Found | None, Effort]:
        """The best certified window from a state, if there is one, and what it took.

        Args:
            field: of the paper's scale.
            vehicle: where the window begins.
        """
        effort = Effort()
        for grain in self.grains:
            nominal = nominal_chain(field, vehicle, grain.stride, self.segments)
            if nominal is None:
                break
            if nominal.route < field.limits.shortest:
                return detour(field, vehicle), effort
            found, effort = self.solver.solve(field, vehicle, nominal, grain.parts, effort)
            if found is not None:
                return found, effort
        return None, effort
