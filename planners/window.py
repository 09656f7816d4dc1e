"""The paper's two optimisation problems: the look-ahead window and the final one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym import flight
from ferguson_gym.fields import Field
from ferguson_gym.limits import Limits
from planners.chain import Chain
from planners.constraints import Constraint, LengthBounds, sampled_clearance
from planners.objectives import HorizonObjective, LengthObjective, Objective
from planners.problem import Problem

DERIVATIVE_BOUND = 1000.0
"""Bound on each coordinate of a derivative [m per unit t]; the paper, section III-C7."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings:
    """The paper's numbers."""

    segments: int = 3
    """Segments planned together."""
    alpha: float = 0.2
    """Weight of directness in the objective; equation (2)."""
    samples: int = 30
    """n_s, uniform parameters at which clearance is required, the first of them t = 0."""


def horizon_problem(
    field: Field,
    vehicle: flight.State,
    limits: Limits,
    settings: WindowSettings,
    segments: int,
) -> Problem:
    """Get close to the goal, directly, past the obstacles within the look-ahead.

    Reference:
        The paper, sections III-C1 to III-C3. Its window test is printed with >=; an
        obstacle counts when it is at most three longest segments away.
    """
    reach = settings.segments * limits.longest
    chain = Chain.from_state(vehicle.position, vehicle.derivative, segments)
    objective = HorizonObjective(field.goal, settings.alpha)
    return _problem(chain, objective, field, limits, settings, reach)


def final_problem(
    field: Field,
    vehicle: flight.State,
    limits: Limits,
    settings: WindowSettings,
    segments: int,
) -> Problem:
    """The shortest chain that ends on the goal, past all obstacles.

    Reference:
        The paper, section III-C4.
    """
    chain = Chain.from_state(vehicle.position, vehicle.derivative, segments)
    chain = chain.ending_at(field.goal)
    return _problem(chain, LengthObjective(), field, limits, settings, np.inf)


def _problem(
    chain: Chain,
    objective: Objective,
    field: Field,
    limits: Limits,
    settings: WindowSettings,
    reach: float,
) -> Problem:
    constraints: list[Constraint] = [LengthBounds(limits, np.zeros(chain.segments))]
    obstacles = field.obstacles.near(chain.knots[0, 0], reach)
    if len(obstacles):
        constraints.append(sampled_clearance(obstacles, settings.samples))
    box = chain.bounds(field.bounds[0], field.bounds[1], DERIVATIVE_BOUND)
    return Problem(chain, objective, constraints, box)
