"""Backtracking: where a planner is stuck, the best open branch is taken.

The path flown is the map of what was visited. A planner that has not come nearer to the goal for
some segments circles among places it has visited, in a concave pocket for example. A guide that
knows the distance to the goal then leads back to where the best way on branches off, and along
it until the vehicle is nearer to the goal than it ever was. So no pocket holds it twice, and every
place where the planner takes over again is nearer than the last.

Reference:
    The paper, section V, proposes it and leaves open how. When to leave a detour is that of
    Kamon, Rimon & Rivlin (1998), TangentBug: a range-sensor-based navigation algorithm,
    International Journal of Robotics Research 17(9).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.transition import fly_segment
from planners.interface import Decision, Plan, Replanner, State
from planners.optimization.certification import WindowSolver
from planners.optimization.initial_guesses import along
from planners.optimization.objectives import HorizonObjective
from planners.optimization.sqp.multi_start import MultiStart, offset_guesses
from planners.optimization.window import ASIDE, SETTINGS, Window, WindowSettings, horizon_window
from planners.rollout import roll_out

_SAMPLES = np.linspace(1.0, 0.0, 33)
"""Parameters of points on a segment that is flown back along."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Backtracking:
    """A planner with a guide out of dead ends.

    Raises:
        ValueError: a patience below 1.
    """

    planner: Replanner
    """Decides as long as it makes progress."""
    guide: Replanner
    """Decides where that is stuck."""
    patience: int = 3
    """Segments that need not lead nearer to the goal."""
    stride: float = 11.0
    """Length of segments at first, where both are stuck and the vehicle flies back [m]."""
    solver: WindowSolver = field(default_factory=lambda: MultiStart(sidesteps=()))
    settings: WindowSettings = SETTINGS

    def __post_init__(self) -> None:
        if self.patience < 1:
            raise ValueError(f"patience is at least 1 segment, got {self.patience}")

    @property
    def limits(self) -> Limits:
        """What a segment may be."""
        return self.planner.limits

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        """Plan from a state to the goal."""
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        """Decide the next segment, and what is meant to follow it."""
        began = time.perf_counter()
        if idle(field, state) < self.patience:
            decision = self.planner.decide(field, state, seed)
            if decision.chain is not None:
                return decision
        decision = self.guide.decide(field, state, seed)
        chain, start = decision.chain, decision.report.start
        if chain is None and (chain := self._back(field, state)) is not None:
            start = "back"
        seconds = time.perf_counter() - began
        return Decision(chain, dataclasses.replace(decision.report, start=start, seconds=seconds))

    def _back(self, field: Field, state: State) -> Array | None:
        """A chain (n, 4, 2) back along the path flown; None if there is none."""
        if len(state.flown) == 0:
            return None
        for window, guess in self._ways_back(field, state):
            (end,) = self.solver.solve(window, [guess])
            if (
                end.feasible
                and fly_segment(field, state.vehicle, end.control[0], self.limits).flown
            ):
                return end.control
        return None

    def _ways_back(self, field: Field, state: State) -> Iterator[tuple[Window, Array]]:
        """Windows towards places visited, and guesses along the path flown and beside it."""
        vehicle = state.vehicle
        points = evaluate(state.flown[::-1], _SAMPLES).reshape(-1, 2)
        for segments in (1, 2):
            guess = along(vehicle, points, segments, segments * self.stride)
            toward = HorizonObjective(vehicle.position, guess[-1, 1], self.settings.alpha)
            window = horizon_window(field, vehicle, self.limits, self.settings, segments)
            window = dataclasses.replace(window, objective=toward)
            for turn in (guess, *offset_guesses(guess, ASIDE)):
                yield window, turn


def idle(field: Field, state: State) -> int:
    """Segments flown since the vehicle was nearest to the goal."""
    visited = np.vstack([state.flown[:, 0], state.vehicle.position])
    distance = np.linalg.norm(visited - field.goal, axis=-1)
    return len(visited) - 1 - int(distance.argmin())
