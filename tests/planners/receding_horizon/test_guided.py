"""The guided horizon: derivatives of its objective, its windows, flights that never get stuck."""

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import State, Status, initial_state
from planners.optimization.distance_objective import ToGoObjective
from planners.receding_horizon.convex import Convex
from planners.receding_horizon.guided import Guided
from planners.registry import make
from tests.support.random_shapes import random_shapes

SEARCH = Guided(convex=None)


def test_the_objective_is_length_and_distance_with_its_derivatives() -> None:
    field = get_field("standard/train:0")
    togo = DistanceToGoal(field)
    objective = ToGoObjective(togo)
    stream, step, checked = np.random.default_rng(0), 1e-4, 0
    for point in stream.uniform(0.0, 100.0, (200, 2)):
        around = point + step * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        distance, gradient = togo(around)
        value, slope, curvature = objective.expand(7.0, point)
        if field.obstacles.signed_distance(point[None]).min() < 0.01:
            continue
        assert value == 7.0 + distance[0]
        np.testing.assert_array_equal(slope, [1.0, *gradient[0]])
        differences = np.stack([gradient[1] - gradient[2], gradient[3] - gradient[4]]) / (2 * step)
        if np.abs(differences).max() < 1.0 and np.linalg.norm(field.goal - point) > 1.0:
            # neither a kink nor the end of a way's first line between them
            checked += np.allclose(curvature[1:, 1:], differences, atol=1e-3)
    assert checked > 100


@pytest.mark.parametrize("depth", [0.5, 2.9])
def test_the_distance_goes_on_into_discs(depth: float) -> None:
    """An iterate of the search may end there, and needs a way out."""
    field = Field(name="disc", obstacles=Obstacles.discs([[50.0, 50.0], [53.0, 50.0]], [3.0, 3.0]))
    outside = np.array([47.0, 50.0])
    inside = np.array([47.0 + depth, 50.0])
    objective = ToGoObjective(DistanceToGoal(field))
    (expected,), _ = DistanceToGoal(field)(outside[None] - [1e-6, 0.0])
    value, slope, curvature = objective.expand(0.0, inside)
    assert value == pytest.approx(expected + depth, abs=1e-5)
    assert np.isfinite(slope).all()
    assert np.isfinite(curvature).all()


@pytest.mark.parametrize(
    "spec", ["paper:1-4", "standard/train:0-14", "traps/train:0-9", "dense/train:0-4"]
)
def test_it_arrives_within_two_thousandths_of_the_exact_length(spec: str) -> None:
    planner = make("guided")
    for field in get_fields(spec):
        plan = planner.plan(field, initial_state(field), 0)
        assert plan.success, field.name
        exact = exact_length(field)
        assert exact is not None
        assert -1e-6 <= length(plan.control).sum() / exact - 1.0 < 2e-3, field.name


@pytest.mark.parametrize("spec", ["town/train:0-3", "walls/train:0-3"])
def test_it_arrives_among_buildings_and_walls(spec: str) -> None:
    for field in get_fields(spec):
        assert_arrives(field)


@pytest.mark.parametrize("seed", range(6))
def test_it_arrives_among_obstacles_of_every_shape(seed: int) -> None:
    obstacles = random_shapes(np.random.default_rng(seed), 40)
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    free = (obstacles.signed_distance(ends) > 0.0).all(axis=0)
    assert_arrives(Field(name="shapes", obstacles=obstacles.only(free)))


def assert_arrives(field: Field) -> None:
    """Certified, and within a few thousandths of the exact length."""
    plan = make("guided").plan(field, initial_state(field), 0)
    assert plan.success, field.name
    assert is_feasible(plan.control, field).all()
    exact = exact_length(field)
    assert exact is not None
    assert -1e-6 <= length(plan.control).sum() / exact - 1.0 < 4e-3, field.name


def test_it_is_deterministic() -> None:
    field = get_field("standard/train:3")
    plans = [make("guided").plan(field, initial_state(field), seed) for seed in (0, 1)]
    np.testing.assert_array_equal(plans[0].control, plans[1].control)


def test_a_convex_window_that_is_good_enough_needs_no_search() -> None:
    field = get_field("standard/train:3")
    plan = make("guided").plan(field, initial_state(field), 0)
    assert {decision.report.start for decision in plan.decisions} == {"convex", "planned"}
    assert not any(decision.candidates for decision in plan.decisions)


def test_other_windows_are_searched_for_and_the_best_is_flown() -> None:
    field = get_field("standard/train:3")
    state = initial_state(field)
    searched = SEARCH.decide(field, state, 0)
    both = Guided(good=-1.0).decide(field, state, 0)
    programs, _ = Convex().window(field, state)
    assert programs is not None
    best = min(searched.report.objective, programs.objective)
    assert both.report.objective == best


def test_searched_windows_have_three_segments_until_the_goal_is_in_reach() -> None:
    field = get_field("standard/train:3")
    plan = SEARCH.plan(field, initial_state(field), 0)
    chains = [decision.chain for decision in plan.decisions]
    final = [decision.report.final for decision in plan.decisions].index(True)
    for decision, chain in zip(plan.decisions[:final], chains, strict=False):
        assert chain is not None
        assert len(chain) == 3
        assert decision.report.start == "class 1"
        assert not np.array_equal(chain[-1, 1], field.goal)
    for decision in plan.decisions[final + 1 :]:
        assert decision.report.start == "planned"


def test_every_window_can_be_continued() -> None:
    """From the end of any window, not only from where it is left."""
    field = get_field("dense/train:1")
    planner = make("guided")
    plan = planner.plan(field, initial_state(field), 0)
    for decision in plan.decisions:
        chain = decision.chain
        assert chain is not None
        if not np.array_equal(chain[-1, 1], field.goal):
            end = transition.State(chain[-1, 1], chain[-1, 3], 3)
            onward = planner.plan(field, State(end), 0)
            assert len(onward.control) > 0
            assert is_feasible(onward.control, field).all()


def test_a_field_without_a_way_is_stuck_at_once() -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = Obstacles.discs(
        6.0 * np.column_stack([np.cos(angles), np.sin(angles)]), np.full(16, 2.0)
    )
    walled = Field(name="ring", obstacles=ring)
    plan = Guided().plan(walled, initial_state(walled), 0)
    assert plan.status is Status.STUCK
    assert len(plan.control) == 0


def test_a_heading_into_a_disc_is_stuck() -> None:
    field = Field(
        name="ahead",
        obstacles=Obstacles.discs([[4.0, 0.0]], [3.5]),
        start_derivative=np.array([60.0, 0.0]),
    )
    assert Guided().plan(field, initial_state(field), 0).status is Status.STUCK


def test_obstacles_other_than_discs_are_refused() -> None:
    spheres = Obstacles.discs([[5.0, 5.0, 5.0]], [1.0])
    field = Field(
        name="space",
        obstacles=spheres,
        start=np.zeros(3),
        goal=np.full(3, 10.0),
        bounds=np.array([[-5.0] * 3, [15.0] * 3]),
    )
    state = State(transition.State(np.zeros(3), np.ones(3)))
    with pytest.raises(TypeError, match="in the plane"):
        Guided().decide(field, state, 0)
