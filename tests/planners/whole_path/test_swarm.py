"""Particle swarms and bee colonies: what they minimise, and the routes they find."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Evaluations, Route, Seconds
from planners.registry import make
from planners.whole_path.swarm import Swarms, bees, particles
from planners.whole_path.swarm_objective import (
    ChainObjective,
    Encoding,
    Penalties,
    chain_objective,
    hierarchical_tents,
)
from tests.support.mixed_fields import mixed_field

SWARMS = {"pso": particles, "abc": bees}
FEW = Evaluations(20_000)


def objective_of(field: Field, encoding: Encoding, penalties: Penalties) -> ChainObjective:
    return chain_objective(field, transition.initial_state(field), encoding, penalties)


def plain_value(objective: ChainObjective, x: np.ndarray, field: Field, p: Penalties) -> float:
    """By the definition: sampled points, every obstacle looked at."""
    control = objective.control(x)
    points = evaluate(control, np.arange(p.samples + 1) / p.samples)
    chords = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    points = points[:, 1:]
    lengths = chords.sum(axis=1)
    depth = p.margin - field.obstacles.signed_distance(points)
    low, high = field.bounds
    outside = np.maximum(np.maximum(low - points, points - high), 0.0).sum(axis=-1)
    per_metre = np.where(depth > 0.0, p.depth * depth + p.inside, 0.0).sum(axis=-1)
    per_metre += np.where(outside > 0.0, p.depth * outside + p.inside, 0.0)
    short = np.maximum(PAPER_LIMITS.shortest - lengths, 0.0)
    long = np.maximum(lengths - PAPER_LIMITS.longest, 0.0)
    return float(lengths.sum() + (per_metre * chords).sum() + p.length * (short + long).sum())


@pytest.mark.parametrize(
    "field",
    [*map(get_field, ("standard/train:0", "dense/train:1", "forest/train:2")), mixed_field(0, 60)],
    ids=lambda field: field.name,
)
def test_the_objective_is_length_and_penalties(field: Field) -> None:
    penalties = Penalties()
    objective = objective_of(field, Encoding(), penalties)
    stream = np.random.default_rng(0)
    for reach in (0.0, 0.1, 0.5, 1.0, 1.0, 1.0):  # the last leave the bounds
        x = reach * stream.uniform(-1.0, 1.0, objective.unknowns)
        expected = plain_value(objective, x, field, penalties)
        assert objective.value(x) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("walls", [False, True])
def test_obstacles_across_the_bounds_are_felt_from_outside(walls: bool) -> None:
    discs = Obstacles.discs([[60.0, -20.0], [115.0, 50.0], [-12.0, -12.0]], [15.0, 30.0, 10.0])
    ends = [[[20.0, 150.0], [50.0, 100.0]], [[-60.0, 40.0], [-12.0, 60.0]]]
    walled = Obstacles.joined([discs, Obstacles.capsules(ends, 3.0)]) if walls else discs
    field, penalties = Field(name="rim", obstacles=walled), Penalties()
    objective = objective_of(field, Encoding(across=1.0), penalties)
    stream = np.random.default_rng(1)
    for _ in range(20):
        x = stream.uniform(-1.0, 1.0, objective.unknowns)
        expected = plain_value(objective, x, field, penalties)
        assert objective.value(x) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(
    ("distance", "segments"), [(0.5, 1), (9.0, 2), (17.0, 4), (33.0, 4), (140.0, 14)]
)
def test_unknowns_are_all_that_a_chain_leaves_free(distance: float, segments: int) -> None:
    goal = (3.0 * distance / 5.0, 4.0 * distance / 5.0)
    field = Field(
        name="open",
        obstacles=Obstacles.discs([], []),
        goal=goal,
        bounds=(-10, 130),
        start_derivative=(2, 1),
    )
    objective = objective_of(field, Encoding(), Penalties())
    straight = objective.control(np.zeros(objective.unknowns))
    n = len(straight)
    assert n == segments
    assert objective.unknowns == 4 * n - 2
    # full rank: every chain of n segments near the straight one can be expressed
    assert np.linalg.matrix_rank(objective.reach) == objective.unknowns
    x = np.random.default_rng(0).uniform(-1.0, 1.0, objective.unknowns)
    for control in (straight, objective.control(x)):
        np.testing.assert_array_equal(control[0, 0], field.start)
        np.testing.assert_array_equal(control[0, 2], field.departure)
        np.testing.assert_array_equal(control[1:, (0, 2)], control[:-1, (1, 3)])
        np.testing.assert_allclose(control[-1, 1], field.goal, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(straight[1:, 2], straight[1:, 1] - straight[1:, 0], atol=1e-12)


def test_on_the_goal_itself_a_chain_has_no_length() -> None:
    field = Field(name="open", obstacles=Obstacles.discs([], []))
    vehicle = transition.State(field.goal, np.array([5.0, 5.0]), 9)
    objective = chain_objective(field, vehicle, Encoding(), Penalties())
    assert objective.unknowns == 2
    control = objective.control(np.ones(2))
    np.testing.assert_array_equal(control[0, :2], [field.goal, field.goal])
    np.testing.assert_array_equal(control[0, 2], vehicle.derivative)


def test_halves_are_tents() -> None:
    np.testing.assert_allclose(
        hierarchical_tents(4), [[0.5, 0.625, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.625]]
    )


def test_swarms_need_a_plane() -> None:
    ball = Obstacles.discs([[50.0, 50.0, 50.0]], [5.0])
    space = Field(name="space", obstacles=ball, start=(0, 0, 0), goal=(100, 100, 100))
    vehicle = transition.State(space.start, space.departure)
    with pytest.raises(ValueError, match="flights are planar"):
        chain_objective(space, vehicle, Encoding(), Penalties())


@pytest.mark.parametrize("name", SWARMS)
def test_without_its_library_a_planner_says_what_to_install(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda module: None)
    with pytest.raises(ValueError, match=rf"'{name}' needs pygmo: .*'\.\[peers\]'"):
        make(name)


@pytest.fixture(scope="module", params=SWARMS)
def swarms(request: pytest.FixtureRequest) -> Swarms:
    pytest.importorskip("pygmo")
    return replace(SWARMS[request.param](), budget=FEW)


def routes(swarms: Swarms, field: Field, *seeds: int) -> list[Route]:
    found = [swarms.route(field, transition.initial_state(field), seed) for seed in seeds]
    assert all(route is not None for route in found)
    return [route for route in found if route is not None]


@pytest.mark.parametrize("name", ["standard/train:0", "sparse/train:1"])
def test_a_route_is_clear_and_leads_to_the_goal(swarms: Swarms, name: str) -> None:
    field = get_field(name)
    (route,) = routes(swarms, field, 0)
    np.testing.assert_array_equal(route.points[0], field.start)
    np.testing.assert_allclose(route.points[-1], field.goal, rtol=0.0, atol=1e-9)
    assert field.obstacles.signed_distance(route.points).min() >= -1e-6
    assert (route.points >= field.bounds[0] - 1e-6).all()
    assert (route.points <= field.bounds[1] + 1e-6).all()
    chords = np.linalg.norm(np.diff(route.points, axis=0), axis=1)
    assert chords.max() < 1.0
    assert chords.sum() <= route.length <= chords.sum() * (1.0 + 1e-3)
    exact = exact_length(field)
    assert exact is not None
    assert exact * (1.0 - 1e-6) <= route.length <= 1.5 * exact
    assert FEW.count <= route.evaluations <= 1.2 * FEW.count
    seconds, lengths = zip(*route.progress, strict=True)
    assert (np.diff(seconds) > 0.0).all()
    assert (np.diff(lengths) < 0.0).all()
    assert lengths[-1] == route.length


def test_a_seed_gives_one_route(swarms: Swarms) -> None:
    first, again, other = routes(swarms, get_field("sparse/train:1"), 0, 0, 1)
    np.testing.assert_array_equal(first.points, again.points)
    assert first.length == again.length
    assert first.evaluations == again.evaluations
    assert first.length != other.length


def test_on_the_way_the_segments_flown_are_part_of_the_seed(swarms: Swarms) -> None:
    field = get_field("sparse/train:1")
    start = transition.initial_state(field)
    first = swarms.route(field, start, 0)
    later = swarms.route(field, replace(start, segments=3), 0)
    assert first is not None
    assert later is not None
    assert first.length != later.length


def test_there_is_no_route_through_a_wall(swarms: Swarms) -> None:
    wall = Obstacles.discs([[50.0, y] for y in range(-10, 111, 5)], [4.0] * 25)
    field = Field(name="wall", obstacles=wall)
    assert swarms.route(field, transition.initial_state(field), 0) is None


@pytest.mark.parametrize(("goal", "flown"), [(1e6, 0), (601.0, 0), (100.0, 34)])
def test_a_goal_out_of_reach_is_not_searched_for(swarms: Swarms, goal: float, flown: int) -> None:
    field = Field(
        name="far",
        obstacles=Obstacles.discs([], []),
        goal=(goal, 0.0),
        bounds=(-1e6, 1e6),
        limits={"segments": 10**6 if goal == 1e6 else 40},
    )
    vehicle = transition.State(field.start, field.departure, flown)
    endless = replace(swarms, budget=Evaluations(10**12))
    assert endless.route(field, vehicle, 0) is None


def test_seconds_end_a_search(swarms: Swarms) -> None:
    field = get_field("sparse/train:1")
    brief = replace(swarms, budget=Seconds(1e-9))
    route = brief.route(field, transition.initial_state(field), 0)
    # one look, after the first generations
    assert route is None or route.evaluations < 0.2 * FEW.count
