"""Planners that stand in for others: crash, fail, report what is not true, or search on."""

import dataclasses
from dataclasses import dataclass, replace

from ferguson_gym.world.field import Field
from ferguson_gym.world.transition import State as Vehicle
from planners.interface import CrashedError, Iterations, Plan, Route, Seconds, State
from planners.whole_path.exact import ShortestPathRouter
from planners.whole_path.planner import WholePath


@dataclass(frozen=True, slots=True)
class Searching:
    """The shortest path as the third of three routes; how long it seeks is only noted."""

    budget: Iterations | Seconds = dataclasses.field(default_factory=lambda: Iterations(3))

    def route(self, field: Field, vehicle: Vehicle, seed: int) -> Route | None:
        route = ShortestPathRouter().route(field, vehicle, seed)
        if route is None:
            return None
        # told in thousandths of a second for each iteration, or of its budget of seconds
        step = 1e-3 if isinstance(self.budget, Iterations) else 1e-3 * self.budget.seconds
        progress = [(step * k, route.length * (1.0 + 0.1 * (3 - k))) for k in (1, 2, 3)]
        return replace(route, progress=progress, evaluations=3)


@dataclass(frozen=True, slots=True)
class Without:
    """Finds no route."""

    def route(self, field: Field, vehicle: Vehicle, seed: int) -> Route | None:
        return None


@dataclass(frozen=True, slots=True)
class Crashing:
    """Loses what does its work."""

    def route(self, field: Field, vehicle: Vehicle, seed: int) -> Route | None:
        raise CrashedError("gone")


@dataclass(frozen=True, slots=True)
class Faulty:
    """Has a mistake in its program, for one field."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        if field.name == "sparse/train:1":
            raise TypeError("no such thing")
        return WholePath(router=ShortestPathRouter()).plan(field, state, seed)


@dataclass(frozen=True, slots=True)
class Lying:
    """Reports a path without its last segment as solved."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        plan = WholePath(router=ShortestPathRouter()).plan(field, state, seed)
        return replace(plan, control=plan.control[:-1])


STUBS = {
    "searching": lambda: WholePath(router=Searching()),
    "without": lambda: WholePath(router=Without()),
    "crashing": lambda: WholePath(router=Crashing()),
    "lying": Lying,
}
