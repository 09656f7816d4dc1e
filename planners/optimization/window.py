"""Windows: optimisation problems over chains, among them the paper's look-ahead and final ones."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.chain import Chain
from planners.optimization.nonlinear_program import Problem
from planners.optimization.objectives import HorizonObjective, LengthObjective, Objective
from planners.optimization.quadrature import lengths
from planners.optimization.sampled_constraints import (
    Constraint,
    LengthBounds,
    SampledClearance,
    sample_weights,
)

DERIVATIVE_BOUND = 1000.0
"""Bound on each coordinate of a derivative [m per unit t]; the paper, section III-C7."""
BENDING_WEIGHT = 1e-5
"""Weight of the integral of |X''|^2 over t [1/m]. Without it, the shortest chains turn with a
radius near zero where a route departs from the vehicle's heading; with it they turn smoothly and
are longer by a few 1e-5."""
SIDE_OFFSET = 3.0
"""Distance by which the ends of guesses are shifted to both sides after a failure [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings:
    """Parameters of windows; the defaults are the paper's."""

    segments: int = 3
    """Segments planned together."""
    alpha: float = 0.2
    """Weight of directness in the objective; equation (2)."""
    samples: int = 30
    """Number n_s of uniform samples at which clearance is required, including t = 0."""
    bending_weight: float = 0.0
    """Weight of the integral of |X''|^2 over t in the objective [1/m]; not in the paper."""


SMOOTH = WindowSettings(bending_weight=BENDING_WEIGHT)
"""The paper's parameters with the small regularisation `BENDING_WEIGHT`."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Window:
    """A chain planned as a whole, its objective and its constraints."""

    chain: Chain
    objective: Objective
    field: Field
    obstacles: Obstacles
    """The obstacles that a solver considers; certification considers all of the field's."""
    samples: int
    """The paper's n_s."""
    bending_weight: float
    """Weight of the integral of |X''|^2 over t in the objective [1/m]; the paper has none."""
    turn_radius: float = 0.0
    """Minimum turn radius [m]; zero allows any."""

    @property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the unknowns, (m,) each."""
        low, high = self.field.bounds
        return self.chain.bounds(low, high, DERIVATIVE_BOUND)

    def admits(self, control: Array) -> NDArray[np.bool_]:
        """Whether chains (count, n, 4, D) satisfy the paper's sampled constraints: (count,)."""
        low, high = self.field.bounds
        points, slopes = control[:, :, 1], control[:, :, 3]
        inside = (points >= low) & (points <= high) & (abs(slopes) <= DERIVATIVE_BOUND)
        length = lengths(control)
        limits = self.field.limits
        fit = (length >= limits.shortest) & (length <= limits.longest)
        admitted = np.asarray(inside.all(axis=(1, 2)) & fit.all(axis=1))
        sampled = sample_weights(self.samples) @ control[admitted]
        count, segments, samples, dimension = sampled.shape
        sets = sampled.reshape(count, segments * samples, dimension)
        admitted[admitted] = self.obstacles.are_free(sets)
        return admitted

    def sampled(self) -> Problem:
        """The window with clearance required at samples, as in the paper, for reference solvers.

        Raises:
            ValueError: a minimum turn radius, for which the paper has no constraint.
        """
        if self.turn_radius > 0.0:
            raise ValueError(
                f"the sampled program has no turn-radius constraint, got {self.turn_radius} m; "
                "planners.optimization.sqp.multi_start.MultiStart keeps one"
            )
        return _sampled(self)


@lru_cache(maxsize=4)
def _sampled(window: Window) -> Problem:
    constraints: list[Constraint] = [
        LengthBounds(window.field.limits, np.zeros(window.chain.segments))
    ]
    if len(window.obstacles):
        constraints.append(SampledClearance(window.obstacles, sample_weights(window.samples)))
    return Problem(window.chain, window.objective, constraints, window.box, window.bending_weight)


def horizon_window(
    field: Field, vehicle: transition.State, settings: WindowSettings, segments: int
) -> Window:
    """The look-ahead window, which minimises d (1 + alpha l / l_min), as in `HorizonObjective`.

    Its obstacles are those at most three longest segments away.

    Reference:
        The paper, sections III-C1 to III-C3. Its test for nearby obstacles is printed with >=.
    """
    return Window(
        chain=Chain.from_state(vehicle.position, vehicle.derivative, segments),
        objective=HorizonObjective(vehicle.position, field.goal, settings.alpha),
        field=field,
        obstacles=field.obstacles.near(vehicle.position, settings.segments * field.limits.longest),
        samples=settings.samples,
        bending_weight=settings.bending_weight,
    )


def final_window(
    field: Field, vehicle: transition.State, settings: WindowSettings, segments: int
) -> Window:
    """The final window: the shortest chain that ends on the goal, among all obstacles.

    Reference:
        The paper, section III-C4.
    """
    chain = Chain.from_state(vehicle.position, vehicle.derivative, segments)
    return Window(
        chain=chain.ending_at(field.goal),
        objective=LengthObjective(),
        field=field,
        obstacles=field.obstacles,
        samples=settings.samples,
        bending_weight=settings.bending_weight,
    )
