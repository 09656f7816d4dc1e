"""The contract of planners, checked on every planner and on planners that break it."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from planners.contract import check_planner
from planners.interface import Decision, Plan, Planner, State
from planners.receding_horizon.pursuit import Pursuit
from planners.registry import PLANNERS
from tests.support.quick_planners import quick

FIELD = get_field("sparse/train:0")


@pytest.mark.parametrize("name", [*PLANNERS, "guided+sensing=20", "guided+margin=0.5"])
def test_every_planner_keeps_its_promises(name: str) -> None:
    plan = check_planner(quick(name), FIELD)
    assert plan.success
    assert plan.certificates is not None


@dataclass(frozen=True)
class Short:
    """Reports a path without its last segment as solved."""

    planner: Planner

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        plan = self.planner.plan(field, state, seed)
        shorter = replace(plan, control=plan.control[:-1], states=plan.states[:-1])
        return replace(shorter, certificates=None)


@dataclass(frozen=True)
class Bent:
    """Moves an inner joint to one side of the segment before it only."""

    planner: Planner

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        plan = self.planner.plan(field, state, seed)
        control = plan.control.copy()
        control[:1, 1] += 1e-9
        return replace(plan, control=control)


class Unseeded:
    """Draws its strides from random numbers that do not depend on the seed."""

    def __init__(self) -> None:
        self._stream = np.random.default_rng(0)

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        stride = float(self._stream.uniform(6.0, 9.0))
        return Pursuit(stride=stride).plan(field, state, seed)


class Hesitant(Pursuit):
    """Plans in another stride than it decides in."""

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        return Pursuit(stride=9.0).decide(field, state, seed)

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        return Pursuit().plan(field, state, seed)


@pytest.mark.parametrize(
    ("planner", "promise"),
    [
        (Short(Pursuit()), "a solved plan ends on the goal"),
        (Bent(Pursuit()), "starts with the point and the derivative"),
        (Unseeded(), "the same seed gives the same plan"),
        (Hesitant(), "the first segment that a replanner decides"),
    ],
)
def test_a_broken_promise_is_named(planner: Planner, promise: str) -> None:
    with pytest.raises(AssertionError, match=promise):
        check_planner(planner, FIELD)
