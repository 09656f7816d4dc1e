"""When a window that has a solution leaves a next one: the statements of docs/convex.md."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.world import transition
from ferguson_gym.world.actions import decode, encode
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import State, Status, initial_state
from planners.optimization.certification import target_tolerance
from planners.optimization.convex import Caps, ChainSolver
from planners.receding_horizon.convex import Convex
from planners.registry import make
from planners.rollout import fly_chain

BLIND = dataclasses.replace(Convex(), solver=ChainSolver(caps=Caps(rows=0)))
"""None of its programs is solved."""
STEEPEST = 4.3904
"""Greatest value at an end of a quadratic polynomial whose absolute value has integral one."""


@pytest.fixture
def reserve(benchmark: Callable[[str], Any]) -> Any:
    return benchmark("convex_reserve")


def test_rounding_moves_the_next_segment_by_less_than_certification_leaves() -> None:
    field = get_field("sparse/train:0")
    left = field.limits.tolerance - target_tolerance(field)
    stream = np.random.default_rng(0)
    position, derivative = np.array([50.0, 50.0]), np.array([7.0, 2.0])
    for _ in range(2000):
        action = stream.uniform(-0.6, 0.6, 4)
        meant = decode(action, position, derivative, field.goal, 0.0, field.limits.unit)
        rounded = encode(meant, position, derivative, field.limits.unit)
        assert rounded.dtype == np.float32
        flown = decode(rounded, position, derivative, field.goal, 0.0, field.limits.unit)
        moved, turned = np.linalg.norm(flown[[1, 3]] - meant[[1, 3]], axis=1)
        # points, lengths and speeds of the next segment change by less
        assert 1.5 * moved + turned < left


def test_a_chain_that_ends_on_the_goal_arrives_where_no_program_is_solved() -> None:
    for field in get_fields("standard/train:0-2"):
        start = initial_state(field)
        whole = make("convex-path").plan(field, start, 0).decisions[0].chain
        assert whole is not None
        plan = BLIND.plan(field, State(start.vehicle, whole), 0)
        assert plan.status is Status.SOLVED
        assert len(plan.control) == len(whole)


def test_with_a_reserve_a_flight_arrives_where_no_program_is_solved(
    reserve: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reserve, "PLANNER", BLIND)
    for name in ("standard/train:0", "town/train:0"):
        flown = reserve.flight(get_field(name), with_reserve=True)
        assert flown.arrived
        assert (flown.counts.joined, flown.counts.shorter) == (0, 0)
        assert flown.counts.planned == flown.counts.windows > 0
        assert not reserve.flight(get_field(name), with_reserve=False).arrived


def test_with_a_reserve_a_flight_is_no_longer_than_the_first_one(reserve: Any) -> None:
    for name in ("standard/train:1", "dense/train:0", "town/train:1"):
        field = get_field(name)
        first = reserve.whole_flight(field, transition.initial_state(field))
        exact = reserve.exact_length(field)
        flown = reserve.flight(field, with_reserve=True)
        assert flown.arrived
        assert flown.counts.shorter > 0
        assert flown.gap <= length(first).sum() / exact - 1.0 + 1e-7


def test_what_is_joined_is_certified_and_continuous(reserve: Any) -> None:
    field = get_field("standard/train:1")
    vehicle = transition.initial_state(field)
    whole = reserve.whole_flight(field, vehicle)
    found, _ = Convex().window(field, initial_state(field))
    assert found is not None
    chain = reserve.joined(found.control, whole, field, field.limits.segments)
    assert chain is not None
    assert is_feasible(chain, field, target_tolerance(field)).all()
    np.testing.assert_array_equal(chain[: len(found.control)], found.control)
    np.testing.assert_array_equal(chain[1:, [0, 2]], chain[:-1, [1, 3]])
    np.testing.assert_array_equal(chain[-1, 1], field.goal)
    # too few segments left for the joint
    assert reserve.joined(found.control, whole, field, len(found.control)) is None


def dead_end() -> tuple[Field, np.ndarray]:
    """A field, and four segments straight ahead whose end is 0.3 m in front of a disc."""
    knots = [20.0, 28.0, 36.0, 44.0, 59.0]
    speeds = [5.0, 6.0, 6.0, 3.0, 39.0]
    chain = np.zeros((4, 4, 2))
    chain[:, :2, 1] = 50.0
    chain[:, 0, 0], chain[:, 1, 0] = knots[:-1], knots[1:]
    chain[:, 2, 0], chain[:, 3, 0] = speeds[:-1], speeds[1:]
    disc = Obstacles.discs([[62.8, 50.0]], [3.5])
    options = {"start": [20.0, 50.0], "start_derivative": [5.0, 0.0]}
    return Field(name="dead end", obstacles=disc, **options), chain


def test_a_window_that_meets_all_constraints_may_end_where_no_segment_begins() -> None:
    field, chain = dead_end()
    assert is_feasible(chain, field, target_tolerance(field)).all()
    # the further rows of the program: derivatives ahead by a fifth of the chord
    chord = (chain[:, 1] - chain[:, 0])[:, 0]
    middle = 3.0 * chord - chain[:, 2, 0] - chain[:, 3, 0]
    assert (np.column_stack([chain[:, 2, 0], middle, chain[:, 3, 0]]) >= 0.2 * chord[:, None]).all()

    # where any next segment is at t = 0.01, from the Hermite form and its greatest length
    t, longest = 0.01, field.limits.longest + field.limits.tolerance
    ahead = 39.0 * (t - 2.0 * t**2 + t**3)
    other = longest * (3.0 * t**2 - 2.0 * t**3) + STEEPEST * longest * (t**2 - t**3)
    end = chain[-1, 1]
    away = np.hypot(field.obstacles.centers[0, 0] - (end[0] + ahead - other), other)
    assert away < field.obstacles.radii[0] - 0.05

    stream = np.random.default_rng(1)
    segments = np.empty((5000, 4, 2))
    segments[:, 0], segments[:, 2] = end, chain[-1, 3]
    segments[:, 1] = end + stream.uniform(-15.0, 15.0, (5000, 2))
    segments[:, 3] = stream.uniform(-66.0, 66.0, (5000, 2))
    assert not is_feasible(segments, field).any()


@pytest.mark.parametrize("name", ["convex", "guided"])
def test_a_flight_that_uses_up_such_a_window_is_stuck(name: str) -> None:
    field, chain = dead_end()
    steps, states = fly_chain(chain, field, initial_state(field))
    assert len(steps) == 4
    assert make(name).plan(field, states[-1], 0).status is Status.STUCK
    # from the state before, there is a way on
    assert make(name).plan(field, State(states[-2].vehicle), 0).success
