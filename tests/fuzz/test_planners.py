"""Planners: from any state in any field a plan that holds, or none; never an error."""

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from ferguson_gym.curves.splines import derivative, evaluate
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.transition import State as Vehicle
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners.interface import Evaluations, Iterations, Plan, Planner, State, Status
from planners.registry import OPTIONS, PLANNERS, make
from planners.whole_path.polish import polish
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import POINTS, WILD, fields, vehicles

T = np.linspace(0.0, 1.0, 201)
SLACK = PAPER_LIMITS.tolerance + 1e-9
BUDGETS: dict[str, Any] = {
    "rrt": Iterations(500),
    "rrt-star": Iterations(200),
    "prm": Iterations(200),
    "bit-star": Iterations(2),
    "pso": Evaluations(3000),
    "abc": Evaluations(3000),
}
MANY = {
    "single-start": 800,
    "multi-start": 150,
    "guided": 800,
    "pursuit": 800,
    "shortest": 1200,
    "voronoi": 1200,
    "astar": 300,
    "rrt": 400,
    "rrt-star": 200,
    "prm": 200,
    "bit-star": 200,
    "pso": 150,
    "abc": 150,
    "gcs": 100,
    "guided+turn=2": 200,
    "guided+margin=0.5": 200,
    "guided+sensing=20": 200,
    "single-start+backtrack": 200,
    "single-start+backtrack+margin=1+sensing=15": 100,
    "pursuit+sensing=16": 200,
}
QUICK = ("single-start", "guided", "pursuit", "shortest", "voronoi")


@cache
def quick(name: str) -> Planner:
    """The planner of a name, with a budget that many cases can afford."""
    try:
        planner: Any = make(name)
    except ValueError as error:
        pytest.skip(str(error))
    if name in BUDGETS:
        router = dataclasses.replace(planner.router, budget=BUDGETS[name])
        planner = dataclasses.replace(planner, router=router)
    return planner


def holds(plan: Plan, field: Field, vehicle: Vehicle) -> None:
    """What every plan promises."""
    control = plan.control
    assert control.shape[1:] == (4, 2)
    assert len(plan.states) == len(control) + 1
    assert vehicle.segments + len(control) <= max(PAPER_LIMITS.segments, vehicle.segments)
    assert np.isfinite(control).all()
    assert plan.success == (plan.status is Status.SOLVED)
    if not len(control):
        assert not plan.success or np.array_equal(vehicle.position, field.goal)
        return
    np.testing.assert_array_equal(control[0, 0], vehicle.position)
    np.testing.assert_array_equal(control[0, 2], vehicle.derivative)
    np.testing.assert_array_equal(control[1:, (0, 2)], control[:-1, (1, 3)])
    assert is_feasible(control, field).all()
    points, slopes = evaluate(control, T), derivative(control, T)
    assert field.obstacles.signed_distance(points).min(initial=np.inf) >= -SLACK
    assert (points >= field.bounds[0] - SLACK).all()
    assert (points <= field.bounds[1] + SLACK).all()
    assert np.linalg.norm(slopes, axis=-1).min() >= PAPER_LIMITS.slowest - SLACK
    arrived = np.array_equal(control[-1, 1], field.goal)
    assert arrived == plan.success


@pytest.mark.parametrize("name", MANY)
def test_a_plan_holds_from_any_state(name: str) -> None:
    planner = quick(name)

    @fuzzed(
        f"planners: {name}",
        few=1,
        many=MANY[name],
        field=fields(most=10),
        data=st.data(),
        seed=st.integers(0, 2**63 - 1),
    )
    def case(field: Field, data: Any, seed: int) -> None:
        vehicle = data.draw(vehicles(field))
        plan = planner.plan(field, State(vehicle), seed)
        holds(plan, field, vehicle)
        assert plan.status is not Status.CRASHED, plan.reason
        if name == "guided+turn=2" and len(plan.control):
            assert keeps_turn_radius(plan.control, 2.0).all()

    case()


WORDS = st.sampled_from(
    [*PLANNERS, *"+=-", "turn", "backtrack", "margin", "sensing", "from", "3", "20", "nan", "inf"]
)


@fuzzed("planners: names", many=6000, words=st.lists(WORDS, max_size=8), text=st.text(max_size=5))
def test_a_planner_s_name_is_known_or_refused(words: list[str], text: str) -> None:
    assert attempt(make, text) is None or text in PLANNERS
    name = "".join(words)
    planner = attempt(make, name)
    assert planner is None or name.partition("+")[0] in PLANNERS
    assert OPTIONS


@fuzzed(
    "planners: names with options",
    many=3000,
    plain=st.sampled_from([*PLANNERS]),
    turn=st.none() | WILD,
    margin=st.none() | WILD,
    sensing=st.none() | WILD,
    backtrack=st.booleans(),
)
def test_options_fit_or_are_refused(
    plain: str, turn: Any, margin: Any, sensing: Any, backtrack: bool
) -> None:
    name = plain + "+backtrack" * backtrack
    for label, value in (("turn", turn), ("margin", margin), ("sensing", sensing)):
        if value is not None:
            name += f"+{label}={value}"
    planner = attempt(make, name)
    if planner is not None:
        assert margin is None or 0.0 < margin < np.inf
        assert sensing is None or sensing >= 15.0
        assert turn is None or 1e-5 < turn < np.inf


@fuzzed(
    "planners: distance to go",
    many=3000,
    field=fields(most=12),
    points=st.lists(st.tuples(POINTS, POINTS), min_size=1, max_size=5),
    far=WILD,
)
def test_a_distance_to_go_is_at_least_the_straight_one(
    field: Field, points: list[tuple[float, float]], far: float
) -> None:
    togo = DistanceToGoal(field)
    distance, gradient = togo(points)
    assert field.obstacles.are_discs
    size = float(np.abs(field.bounds).max()) + float(field.obstacles.radii.max(initial=0.0))
    straight = np.linalg.norm(np.array(points) - field.goal, axis=-1)
    assert (distance >= straight - 1e-6 - 1e-8 * size).all()
    norms = np.linalg.norm(gradient, axis=-1)
    assert (np.isclose(norms, 1.0) | (norms == 0.0)).all()
    for point, there in zip(points, distance, strict=True):
        path = togo.path(point)
        assert (path is None) == np.isinf(there)
        if path is not None:
            assert path.length == pytest.approx(there, rel=1e-12)
            assert np.isfinite(path.points(1.0)[:, 0]).all()
    attempt(togo, [(far, far)])


@fuzzed("planners: polish", few=2, many=300, field=fields(most=6))
def test_a_polished_flight_is_no_longer(field: Field) -> None:
    plan = quick("shortest").plan(field, State(Vehicle(field.start, field.departure)), 0)
    if plan.path is None:
        return
    polished = polish(plan.control, field)
    assert is_feasible(polished, field).all()
    assert len(polished) == len(plan.control)
    attempt(polish, plan.control[:-1], field)
