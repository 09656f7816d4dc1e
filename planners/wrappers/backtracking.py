"""Backtracking: a planner with a guide that leads it out of dead ends.

A planner that has not come nearer to the goal for some segments is circling, for example in a
concave pocket. A guide that knows the distance to the goal then decides until the vehicle is nearer
to the goal than ever before. Therefore no pocket traps the flight twice: each time the planner
takes over again, it is nearer to the goal than the last time.

Reference:
    The paper, section V, proposes it without details. The condition for returning to the planner is
    that of TangentBug: Kamon, Rimon & Rivlin (1998), TangentBug: a range-sensor-based navigation
    algorithm, International Journal of Robotics Research 17(9).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Step, fly_segment
from planners.interface import Decision, Knowledge, Replanner, State, knowledge_of
from planners.optimization import MultiStart, along_route, offset_guesses
from planners.optimization.certification import WindowSolver
from planners.optimization.objectives import HorizonObjective
from planners.optimization.window import SIDE_OFFSET, SMOOTH, Window, WindowSettings, horizon_window
from planners.rescaling import decided_in_image
from planners.rollout import StepByStep

_SAMPLES = np.linspace(1.0, 0.0, 33)
"""Parameters of points on a segment flown backwards."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Backtracking(StepByStep):
    """A planner with a guide out of dead ends.

    Raises:
        ValueError: a patience below 1.
    """

    planner: Replanner
    """Decides while it makes progress."""
    guide: Replanner
    """Decides while the planner makes no progress or finds no chain."""
    patience: int = 3
    """Number of segments without progress after which the guide decides."""
    stride: float = 11.0
    """Segment length of initial guesses where both fail and the vehicle flies back [m]."""
    solver: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    """Solves the windows that lead back."""
    settings: WindowSettings = SMOOTH

    def __post_init__(self) -> None:
        if self.patience < 1:
            raise ValueError(f"patience is at least 1 segment, got {self.patience}")

    @property
    def knows(self) -> Knowledge:
        """What the planner and the guide know together."""
        return knowledge_of(self.planner, self.guide)

    @decided_in_image
    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Choose the next segment and tentative further ones."""
        began = time.perf_counter()
        if segments_without_progress(field, state) < self.patience:
            decision = self.planner.decide(field, state, seed)
            if decision.chain is not None:
                return decision
        decision = self.guide.decide(field, state, seed)
        chain, step, start = decision.chain, decision.first_step, decision.report.start
        if chain is None and (back := self._fly_back(field, state)) is not None:
            (chain, step), start = back, "back"
        report = dataclasses.replace(
            decision.report, start=start, seconds=time.perf_counter() - began
        )
        return Decision(chain, report, first_step=step)

    def _fly_back(self, field: Field, state: State) -> tuple[Array, Step] | None:
        """A chain (n, 4, 2) back along the path flown, and its first segment as flown."""
        if len(state.flown) == 0:
            return None
        for window, guess in self._windows_back(field, state):
            (end,) = self.solver.solve(window, [guess])
            if end.feasible:
                step = fly_segment(field, state.vehicle, end.control[0])
                if step.flown:
                    return end.control, step
        return None

    def _windows_back(self, field: Field, state: State) -> Iterator[tuple[Window, Array]]:
        """Windows towards visited points, with guesses along the path flown and beside it."""
        vehicle = state.vehicle
        points = evaluate(state.flown[::-1], _SAMPLES).reshape(-1, 2)
        for segments in (1, 2):
            guess = along_route(vehicle, points, segments, segments * self.stride)
            toward = HorizonObjective(vehicle.position, guess[-1, 1], self.settings.alpha)
            window = horizon_window(field, vehicle, self.settings, segments)
            window = dataclasses.replace(window, objective=toward)
            for start in (guess, *offset_guesses(guess, SIDE_OFFSET)):
                yield window, start


def segments_without_progress(field: Field, state: State) -> int:
    """Number of segments flown since the vehicle was nearest to the goal."""
    visited = np.vstack([state.flown[:, 0], state.vehicle.position])
    distance = np.linalg.norm(visited - field.goal, axis=-1)
    return len(visited) - 1 - int(distance.argmin())
