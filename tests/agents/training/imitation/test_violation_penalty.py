"""The price of violations: nothing for an expert in the open, and downhill it leads out."""

import itertools
from typing import Any, NamedTuple

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from agents.training.imitation.mirror import mirrored_cores
from agents.training.imitation.near_obstacles import near_obstacles
from agents.training.imitation.violation_penalty import (
    CLEARANCE,
    _clearance,
    _decoded,
    speed_of,
    violation,
)
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.world import transition
from ferguson_gym.world.actions import decode, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.interface import initial_state
from planners.receding_horizon.pursuit import Pursuit

AHEAD = State(np.array([0.0, 0.0]), np.array([7.0, 0.0]))
"""At the origin, heading along the first axis: its frame is the world's."""
FAR = torch.tensor([[[50.0, 0.0, 1.0]]])


GOAL = torch.tensor([[90.0, 0.0]])


def priced(
    actions: Any, discs: Any = None, speed: float = 7.0, goal: tuple[float, float] = (90.0, 0.0)
) -> Any:
    """Violations of actions (n, 4) among discs (K, 3) that are all there, before a goal."""
    actions = torch.as_tensor(np.asarray(actions, np.float32))
    discs = FAR if discs is None else torch.as_tensor(np.asarray(discs, np.float32))[None]
    discs = discs.expand(len(actions), -1, -1)
    goals = torch.tensor([goal]).expand(len(actions), -1)
    speeds = torch.full((len(actions),), speed)
    return violation(actions, speeds, goals, discs, torch.ones(discs.shape[:2]))


def ahead_of(point: Array, vehicle: State) -> Array:
    """A point (2,) in a vehicle's frame."""
    forward = vehicle.derivative / np.linalg.norm(vehicle.derivative)
    away = point - vehicle.position
    return np.array([forward @ away, forward[0] * away[1] - forward[1] * away[0]])


def test_a_segment_ends_on_the_goal_or_leaves_room_for_another_one() -> None:
    action = towards(8.0, 1.0)[None]
    for left, costs in ((0.0, False), (0.6, False), (1.2, True), (3.0, True), (3.7, False)):
        for side in (-1.0, 1.0):
            assert (priced(action, goal=(8.0, 1.0 + side * left)) > 0.01).all() == costs, left
    # beside the goal the nearer way out is downhill
    at_once = torch.from_numpy(action.copy()).requires_grad_()
    near = torch.tensor([[9.3, 1.0]])
    nothing = torch.zeros(1, 1)
    cost = violation(at_once, torch.tensor([7.0]), near, FAR, nothing).sum()
    (gradient,) = torch.autograd.grad(cost, at_once)
    after = (at_once - 0.01 * gradient / gradient.norm()).detach()
    assert violation(after, torch.tensor([7.0]), near, FAR, nothing) < cost


def towards(x: float, y: float, along: float = 7.0, across: float = 0.0) -> Array:
    """The action of a segment to a point, arriving with a derivative."""
    control = np.array([[0.0, 0.0], [x, y], AHEAD.derivative, [along, across]])
    return encode(control, AHEAD.position, AHEAD.derivative)


def test_actions_are_decoded_as_the_environment_does_it_up_to_rounding() -> None:
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (200, 4)).astype(np.float32)
    actions[:16] = list(itertools.product([-1.0, 1.0], repeat=4))
    actions[16] = 0.0
    ends, slopes = _decoded(torch.from_numpy(actions.astype(np.float64)))
    nowhere = np.array([1e6, 1e6])
    for action, end, slope in zip(actions, ends.numpy(), slopes.numpy(), strict=True):
        control = decode(action, AHEAD.position, AHEAD.derivative, nowhere, 1.0)
        np.testing.assert_allclose(end, control[1], rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(slope, control[3], rtol=0.0, atol=1e-12)


def test_the_speed_is_the_one_that_an_observation_shows() -> None:
    speeds = np.array([0.1, 1.0, 5.0, 7.0, 30.0, 65.0])
    vehicles = [State(np.zeros(2), np.array([0.6 * v, 0.8 * v])) for v in speeds]
    seen = observe(get_field("sparse/train:0"), vehicles, Settings())["vehicle"]
    np.testing.assert_allclose(speed_of(torch.from_numpy(seen[:, 4].copy())), speeds, rtol=1e-5)


class Flown(NamedTuple):
    clearance: Array
    """Of each segment and a stride beyond its end [m]."""
    violation: Array


def flown(spec: str) -> Flown:
    """What an expert's segments cost, and how near to obstacles they are."""
    clearance, costs = [], []
    view = Settings(observation="discs", nearest=12, focus=8.0)
    for field in get_fields(spec):
        plan = Pursuit().plan(field, initial_state(field), 0)
        vehicles = [state.vehicle for state in plan.states[:-1]]
        seen = observe(field, vehicles, view)
        rows = view.view * seen["obstacles"].reshape(len(vehicles), -1, 4)[:, :, :3]
        actions = [
            encode(control, vehicle.position, vehicle.derivative)
            for control, vehicle in zip(plan.control, vehicles, strict=True)
        ]
        price = violation(
            torch.from_numpy(np.array(actions)),
            speed_of(torch.from_numpy(seen["vehicle"][:, 4].copy())),
            torch.from_numpy(np.array([ahead_of(field.goal, one) for one in vehicles], np.float32)),
            torch.from_numpy(rows),
            torch.from_numpy(seen["mask"].copy()),
        )
        ends, slopes = plan.control[:, 1], plan.control[:, 3]
        onward = slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
        beyond = np.stack([field.obstacles.signed_distance(ends + far * onward) for far in (1, 2)])
        near = np.minimum(field.obstacles.clearance(plan.control), beyond.min(axis=(0, 2)))
        clearance += near.tolist()
        costs += price.tolist()
    return Flown(np.array(clearance), np.array(costs))


def test_an_expert_s_segments_cost_nothing_in_the_open_and_little_anywhere() -> None:
    found = flown("standard/train:0-3")
    open_air = found.clearance > CLEARANCE + 0.05
    assert open_air.sum() > 40
    assert found.violation[open_air].max() == 0.0
    assert found.violation.max() < 1.0


def test_segments_that_are_fine_cost_nothing() -> None:
    assert priced([towards(7.0, 0.0), towards(6.0, 2.0, 6.0, 3.0), np.zeros(4)]).tolist() == [0] * 3
    # beside a disc with all the clearance that is asked for; not with less, nor in its way
    for gap, free in ((CLEARANCE + 0.01, True), (CLEARANCE - 0.1, False), (-1.0, False)):
        (cost,) = priced([towards(7.0, 0.0)], [[3.5, 2.0 + gap, 2.0]]).tolist()
        assert (cost == 0.0) == free


def test_deeper_cuts_cost_more() -> None:
    costs = [float(priced([towards(7.0, 0.0)], [[3.5, y, 2.0]])) for y in (2.2, 1.8, 1.2, 0.6)]
    assert 0.0 < costs[0] < costs[1] < costs[2] < costs[3]


def test_a_disc_just_beyond_the_end_costs_too() -> None:
    # nothing is cut yet, but the next segment cannot but do so
    (cost,) = priced([towards(7.0, 0.0)], [[9.5, 0.0, 1.5]]).tolist()
    assert cost > 0.1
    (turned,) = priced([towards(7.0, 0.0, 1.0, 6.5)], [[11.0, 0.0, 3.0]]).tolist()
    assert turned < cost


@pytest.mark.parametrize(
    ("length", "free"), [(2.5, False), (4.0, True), (14.0, True), (15.0, False)]
)
def test_segments_too_short_or_too_long_cost(length: float, free: bool) -> None:
    (cost,) = priced([towards(length, 0.0, length)], speed=length).tolist()
    assert (cost == 0.0) == free


def test_a_segment_that_nearly_stops_costs() -> None:
    (cost,) = priced([towards(7.0, 0.0, 0.2)]).tolist()
    assert cost > 0.3


def test_rows_of_padding_are_nothing() -> None:
    discs = torch.tensor([[[3.5, 0.0, 2.0], [0.0, 0.0, 0.0]]])
    action = torch.from_numpy(towards(7.0, 0.0))[None]
    cost = [
        float(violation(action, torch.tensor([7.0]), GOAL, discs, torch.tensor([present])))
        for present in ([1.0, 1.0], [1.0, 0.0], [0.0, 0.0])
    ]
    assert cost[0] > 0.0  # a disc of no size at the start does not matter here or there
    assert cost[1] > 0.0
    assert cost[2] == 0.0


def descended(action: Array, field: Field, vehicle: State, steps: int = 150) -> Array:
    """The action some way down the price."""
    flights = SimulatedRollouts([field], [0], [vehicle], Settings())
    rows, present = map(torch.from_numpy, near_obstacles(flights.buffers))
    speed = torch.tensor([float(np.linalg.norm(vehicle.derivative))])
    goal = torch.from_numpy(ahead_of(field.goal, vehicle).astype(np.float32)[None])
    free = torch.from_numpy(action[None].copy()).requires_grad_()
    descent = torch.optim.Adam([free], lr=0.02)
    for _ in range(steps):
        cost = violation(free.clamp(-1.0, 1.0), speed, goal, rows, present).sum()
        if cost.item() == 0.0:
            break
        descent.zero_grad()
        cost.backward()
        descent.step()
    moved: Array = free.detach().clamp(-1.0, 1.0)[0].numpy()
    return moved


def in_squares(field: Field) -> Field:
    """A field with a square inside each of its discs."""
    corners = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    discs = field.obstacles
    squares = discs.centers[:, None] + discs.radii[:, None, None] * corners
    return Field(name=f"squares in {field.name}", obstacles=Obstacles.polygons(list(squares)))


@pytest.mark.parametrize("shape", ["discs", "squares"])
def test_downhill_segments_become_feasible(shape: str) -> None:
    stream = np.random.default_rng(1)
    tried = led_out = 0
    for discs in get_fields("standard/train:20-23"):
        # flights among the discs are flights among what is in them
        field = discs if shape == "discs" else in_squares(discs)
        plan = Pursuit().plan(discs, initial_state(discs), 0)
        for state in plan.states[1:-2]:
            action = stream.uniform(-0.6, 0.6, 4).astype(np.float32)
            if transition.advance(field, state.vehicle, action).flown:
                continue
            tried += 1
            after = descended(action, field, state.vehicle)
            led_out += transition.advance(field, state.vehicle, after).flown
    assert tried > 20
    # where an obstacle is hit in its middle there may be no way out downhill
    assert led_out >= 0.8 * tried, (led_out, tried)


@pytest.mark.parametrize(
    ("action", "why"),
    [
        (towards(8.0, 0.0), "through a disc"),
        (towards(2.0, 0.0, 2.0), "too short"),
        (towards(12.0, 1.0, 0.0, 45.0), "too long"),
        (towards(6.0, 0.01, -2.0), "turns on the spot"),
    ],
)
def test_each_fault_alone_is_mended_downhill(action: Array, why: str) -> None:
    discs = Obstacles.discs([[4.0, -2.5], [80.0, 80.0]], [3.0, 1.0])
    if why != "through a disc":
        discs = discs.only(np.array([False, True]))
    field = Field(name="one", obstacles=discs, start=[0.0, 0.0], start_derivative=[7.0, 0.0])
    vehicle = transition.initial_state(field)
    assert not transition.advance(field, vehicle, action).flown
    assert transition.advance(field, vehicle, descended(action, field, vehicle)).flown


def test_clearance_is_that_of_the_field_in_and_beside_every_shape() -> None:
    stream = np.random.default_rng(2)
    triangles = stream.uniform(2.0, 14.0, (3, 1, 2)) + stream.normal(size=(3, 3, 2))
    obstacles = Obstacles.joined(
        [
            Obstacles.polygons(list(triangles), [0.0, 0.4, 1.0]),
            Obstacles.boxes([[1.0, -8.0]], [[6.0, -3.0]]),
            Obstacles.capsules([[[-3.0, 5.0], [4.0, 7.0]]], 0.5),
            Obstacles.discs([[8.0, -6.0]], [2.0]),
        ]
    )
    for one in [obstacles, *(obstacles.only_these(np.array([k])) for k in range(6))]:
        field = Field(name="shapes", obstacles=one, start=[-9.0, -9.0], goal=[100.0, 100.0])
        flights = SimulatedRollouts([field], [0], [AHEAD], Settings())
        rows, present = map(torch.from_numpy, near_obstacles(flights.buffers))
        points = stream.uniform([-4.0, -9.0], 14.0, (1, 999, 2)).astype(np.float32)
        found = _clearance(torch.from_numpy(points), rows, present)
        expected = np.minimum(one.signed_distance(points[0].astype(float)).min(axis=1), 9.0)
        np.testing.assert_allclose(found[0], expected, atol=1.1e-3)
        image = torch.from_numpy(points * np.array([1.0, -1.0], np.float32))
        mirrored = _clearance(image, mirrored_cores(rows), present)
        np.testing.assert_allclose(mirrored, found, atol=1e-5)
        assert (expected < -0.1).any()


def test_gradients_are_finite_everywhere() -> None:
    corners = list(itertools.product([-1.0, 0.0, 1.0], repeat=4))
    at_once = torch.tensor(corners, requires_grad=True)
    # the middle of a segment straight ahead, its end and its start are centres of discs
    discs = torch.tensor([[[4.5, 0.0, 2.0], [9.0, 0.0, 0.5], [0.0, 0.0, 1.0], [10.0, 0.0, 1.0]]])
    # and a square around the middle, and a line up to its end
    square = [4.0, -0.5, 5.0, -0.5, 5.0, 0.5, 4.0, 0.5, 0.2]
    line = [9.0, 0.0, 9.0, 4.0, 9.0, 4.0, 9.0, 4.0, 0.1]
    shapes = torch.tensor([[square, line, square, line]])
    number = len(corners)
    for speed, obstacles in itertools.product((0.0, 0.1, 9.0, 66.0), (discs, shapes)):
        cost = violation(
            at_once,
            torch.full((number,), speed),
            torch.tensor([[10.0, 0.0]]).expand(number, -1),
            obstacles.expand(number, -1, -1),
            torch.ones(number, 4),
        )
        (gradient,) = torch.autograd.grad(cost.sum(), at_once)
        assert torch.isfinite(cost).all()
        assert torch.isfinite(gradient).all()
        assert (cost > 0.0).all()
