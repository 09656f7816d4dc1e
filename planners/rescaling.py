"""Planning in fields of any scale: planners see each field as one of the paper's scale.

Lengths that planners and solvers have of their own, such as strides, spacings and precisions, are
written for fields that start at the origin and whose longest segment is 15 m; there, their unit is
1 m. `ferguson_gym.world.similarity` maps any other field to such a field.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from ferguson_gym.world import Field
from ferguson_gym.world.similarity import Similarity, similarity
from planners.interface import Decision, Route, State

P = TypeVar("P")


def state_in_image(seen: Similarity, state: State) -> State:
    """A flight's state in the image of its field."""
    tail, flown = seen.control(state.tail), seen.control(state.flown)
    return State(seen.state(state.vehicle), tail, flown)


def route_back(seen: Similarity, route: Route) -> Route:
    """The route in the field of a route in its image."""
    return dataclasses.replace(
        route,
        points=seen.points_back(route.points),
        length=route.length / seen.scale,
        progress=[(seconds, length / seen.scale) for seconds, length in route.progress],
    )


def decided_in_image(
    decide: Callable[[P, Field, State, int], Decision],
) -> Callable[[P, Field, State, int], Decision]:
    """Let a planner's `decide` see fields of any scale as fields of the paper's scale.

    Attributes that the planner's class names in `METRES` are lengths in the field [m]; they are
    scaled with it. The rollout certifies the segment in the field itself.
    """

    @wraps(decide)
    def decide_in_image(self: P, field: Field, state: State, seed: int) -> Decision:
        seen = similarity(field)
        if seen is None:
            return decide(self, field, state, seed)
        found = decide(_scaled(self, seen.scale), seen.image, state_in_image(seen, state), seed)
        report = dataclasses.replace(found.report, objective=found.report.objective / seen.scale)
        return Decision(
            None if found.chain is None else seen.control_back(found.chain),
            report,
            [(name, seen.control_back(guess)) for name, guess in found.candidates],
        )

    return decide_in_image


def _scaled(planner: P, scale: float) -> P:
    """The planner with its lengths in metres multiplied by a scale."""
    changes = {
        name: scale * length
        for name in getattr(planner, "METRES", ())
        if (length := getattr(planner, name)) is not None
    }
    some: Any = planner
    scaled: P = dataclasses.replace(some, **changes) if changes else planner
    return scaled
