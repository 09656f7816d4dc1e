"""Whether the goal of a field can be reached at all: the answer that every planner shares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world import Field
from planners.interface import Plan, Status, initial_state

_ROUNDING = 1e-6
"""Relative amount by which a flight may be shorter than the shortest path, within the tolerance."""
_AHEAD = 0.3
"""Distance ahead of the start within which an obstacle is close [units of the field]."""
_UNEXPLAINED = (Status.STUCK, Status.NO_ROUTE, Status.NOT_FITTED, Status.OUT_OF_SEGMENTS)
"""Failures that say nothing about whether other planners would succeed."""


def unreachable_plan(field: Field, *, exact: bool = True) -> Plan | None:
    """The empty plan of a field whose goal no flight from the start reaches; None for any other.

    Its status is `NO_WAY` or `TOO_FAR`, and its `reason` has the lengths.

    Args:
        field: where to plan.
        exact: whether to find the shortest path, which takes seconds among thousands of obstacles;
            without it only the straight distance is compared with the limits.

    Raises:
        ValueError: a field that is not planar.
    """
    found = why_unreachable(field, exact_length(field) if exact else None, exact=exact)
    if found is None:
        return None
    status, reason = found
    empty: Array = np.empty((0, 4, 2))
    states = [initial_state(field)]
    return Plan(status, empty, states, [], reason=reason, certificates=[], field=field)


def why_unreachable(
    field: Field, length: float | None, *, exact: bool = True
) -> tuple[Status, str] | None:
    """The status and the reason if no flight from the start reaches the goal; otherwise None.

    Args:
        field: where to fly.
        length: of its shortest path [m], None if there is none.
        exact: whether `length` is known; otherwise the straight distance takes its place.
    """
    if exact and field.obstacles.dimension == 2 and length is None:
        return Status.NO_WAY, ""
    limits = field.limits
    needed = field.distance if length is None else length
    if needed * (1.0 - _ROUNDING) <= limits.segments * (limits.longest + limits.tolerance):
        return None
    what = "the straight distance to the goal" if length is None else "the shortest path"
    return Status.TOO_FAR, (
        f"{what} is {needed:.5g} m, and {limits.segments} segments of at most "
        f"{limits.longest:g} m fly {limits.segments * limits.longest:g} m"
    )


def explained(plan: Plan, field: Field) -> Plan:
    """A failed plan from the start of a field with the status `NO_WAY` or `TOO_FAR` if that is why.

    The shortest path is found only if the status of the plan leaves the cause open.
    """
    if plan.status not in _UNEXPLAINED:
        return plan
    found = why_unreachable(field, exact_length(field))
    return plan if found is None else replace(plan, status=found[0], reason=found[1])


def start_hint(field: Field) -> str:
    """Why no segment may leave the start of a field; empty if its derivative is not the cause.

    A segment that begins on an obstacle's boundary and heads into the obstacle cuts into it, and
    one that heads into an obstacle close ahead can hardly turn away in time.
    """
    if len(field.obstacles) == 0:
        return ""
    distance = field.obstacles.signed_distance(field.start)
    inwards = field.obstacles.gradient(field.start) @ field.departure < 0.0
    blocking = np.flatnonzero((distance <= field.limits.tolerance) & inwards)
    if len(blocking):
        where = f"the start touches obstacle {blocking[0]}"
    else:
        ahead = _AHEAD * field.limits.unit * field.departure / np.linalg.norm(field.departure)
        straight = np.stack([field.start, field.start + ahead, ahead, ahead])
        clearance, _ = field.obstacles.closest(straight)
        if clearance.min() >= -field.limits.tolerance:
            return ""
        nearest = int(clearance.argmin())
        where = f"obstacle {nearest} is {distance[nearest]:.2g} m from the start"
    return (
        f"{where}, and the start derivative heads into it; give the field a start_derivative that "
        "leads away from the obstacle"
    )
