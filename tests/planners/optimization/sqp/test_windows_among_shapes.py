"""Windows among polygons, capsules and discs: solved, certified, and as good as SLSQP's."""

import numpy as np
import pytest

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State, initial_state
from planners.optimization.certification import TARGET_TOLERANCE
from planners.optimization.initial_guesses import along_route, straight_ahead
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import (
    SMOOTH,
    Window,
    WindowSettings,
    final_window,
    horizon_window,
)
from tests.support.random_shapes import window_among_shapes

ALONE = MultiStart(sidesteps=())


def assert_certified(window: Window, control: np.ndarray) -> None:
    assert is_feasible(control, window.field, TARGET_TOLERANCE).all()
    points = evaluate(control, np.linspace(0.0, 1.0, 2001))
    assert window.field.obstacles.signed_distance(points).min() >= -2e-6


@pytest.mark.parametrize("shape", ["polygons", "rounded", "capsules"])
def test_most_windows_from_random_guesses_are_solved(shape: str) -> None:
    solved = 0
    for seed in range(40):
        window, guess = window_among_shapes(seed, 60, kinds=(shape,))
        (end,) = ALONE.solve(window, [guess])
        assert end.solution.evaluations < 500
        if end.feasible:
            solved += 1
            assert_certified(window, end.control)
    assert solved >= 34


HOUSES = Obstacles.joined(
    [
        Obstacles.polygons([[[6.0, 2.0], [11.0, 2.0], [11.0, 7.0], [6.0, 7.0]]]),
        Obstacles.polygons([[[14.0, 9.0], [20.0, 12.0], [16.0, 17.0]]], 0.5),
        Obstacles.capsules([[[4.0, 10.0], [9.0, 14.0]]], 0.4),
        Obstacles.discs([[22.0, 20.0]], [2.0]),
    ]
)


@pytest.mark.parametrize("radius", [0.0, 0.5])
@pytest.mark.parametrize(
    ("final", "by"),
    [
        (False, [[14.5, 4.0], [24.0, 14.0]]),
        (False, [[3.0, 8.0], [12.0, 17.0]]),
        (True, [[3.0, 8.0], [12.0, 17.0]]),
    ],
)
def test_minima_are_those_of_slsqp_from_the_same_guess(
    final: bool, by: list[list[float]], radius: float
) -> None:
    houses = HOUSES.grown(np.full(len(HOUSES), radius))
    field = Field(name="houses", obstacles=houses, goal=[26.0, 24.0] if final else [60.0, 60.0])
    make, vehicle = final_window if final else horizon_window, initial_state(field)
    window = make(field, vehicle, SMOOTH, 3)
    guess = along_route(vehicle, np.array([[0.0, 0.0], *by, [26.0, 24.0]]), 3, 36.0)
    (ours,), (theirs,) = ALONE.solve(window, [guess]), ByExchange().solve(window, [guess])
    assert ours.feasible
    assert_certified(window, ours.control)
    # SLSQP may end within millimetres of the obstacles, where points at fixed parameters slip past
    # a corner, or at a worse minimum
    assert ours.solution.objective <= theirs.solution.objective * (1.0 + 1e-4)
    if theirs.feasible and radius > 0.0:
        assert ours.solution.objective == pytest.approx(theirs.solution.objective, rel=2e-3)
    (again,) = ByExchange().solve(window, [ours.control])
    assert again.solution.objective >= ours.solution.objective * (1.0 - 1e-3)


@pytest.mark.parametrize("radius", [0.0, 0.5])
@pytest.mark.parametrize("aside", [-2.0, 0.5, 2.9])
def test_a_guess_through_a_house_is_pushed_out(aside: float, radius: float) -> None:
    house = Obstacles.boxes([[10.0, aside - 4.0]], [[18.0, aside + 4.0]], radius)
    field = Field(name="house", obstacles=house, goal=[40.0, 0.0])
    window = final_window(field, initial_state(field), SMOOTH, 4)
    guess = along_route(initial_state(field), np.array([field.start, field.goal]), 4, 40.0)
    (end,) = ALONE.solve(window, [guess])
    assert end.feasible
    assert_certified(window, end.control)
    # round the nearer side, along the shortest way with smooth turns
    corner = abs(aside) - 4.0 - radius
    assert end.solution.objective < np.hypot(10.0, corner) + 8.0 + np.hypot(22.0, corner) + 0.2


@pytest.mark.parametrize("height", [1.0, 3.0])
def test_a_guess_through_a_wall_is_pushed_round_its_end(height: float) -> None:
    wall = Obstacles.capsules([[[15.0, -20.0], [15.0, height]]], 0.2)
    field = Field(name="wall", obstacles=wall, goal=[30.0, 0.0], bounds=[-30.0, 60.0])
    window = final_window(field, initial_state(field), SMOOTH, 3)
    guess = along_route(initial_state(field), np.array([field.start, field.goal]), 3, 30.0)
    (end,) = ALONE.solve(window, [guess])
    assert end.feasible
    assert_certified(window, end.control)
    assert end.solution.objective < 2.0 * np.hypot(15.0, height + 0.2) + 0.1


def test_a_needle_between_samples_is_avoided() -> None:
    needle = Obstacles.polygons([[[4.69, 4.71], [4.7, 4.69], [4.71, 4.705]]])
    field = Field(name="needle", obstacles=needle)
    window = horizon_window(field, initial_state(field), WindowSettings(), 3)
    (end,) = ALONE.solve(window, [straight_ahead(initial_state(field), 3, PAPER_LIMITS)])
    assert end.feasible
    assert_certified(window, end.control)


def test_a_vehicle_in_a_house_has_no_feasible_window() -> None:
    house = Obstacles.boxes([[10.0, 10.0]], [[18.0, 18.0]])
    field = Field(name="house", obstacles=house)
    vehicle = State(np.array([14.0, 13.0]), np.array([3.0, 4.0]))
    window = horizon_window(field, vehicle, WindowSettings(), 3)
    (end,) = ALONE.solve(window, [straight_ahead(vehicle, 3, PAPER_LIMITS)])
    assert not end.feasible
    assert np.isfinite(end.control).all()


@pytest.mark.parametrize("by", [[13.0, 5.0], [13.5, 3.0]])
@pytest.mark.parametrize("radius", [0.0, 0.5])
def test_a_search_that_stalls_ends_at_a_feasible_iterate(radius: float, by: list[float]) -> None:
    """A joint slides round a corner, and later steps lead away from feasible chains."""
    houses = HOUSES.grown(np.full(len(HOUSES), radius))
    field = Field(name="houses", obstacles=houses, goal=[26.0, 24.0])
    window, vehicle = final_window(field, initial_state(field), SMOOTH, 3), initial_state(field)
    guess = along_route(vehicle, np.array([[0.0, 0.0], by, [24.0, 14.0], [26.0, 24.0]]), 3, 38.0)
    (end,) = ALONE.solve(window, [guess])
    assert end.feasible
    assert_certified(window, end.control)
    assert end.solution.objective < 38.9
