"""The fastest flight along a given path, compared with closed forms and with other programs."""

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.optimize import linprog

from ferguson_gym.curves.splines import curvature
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.vehicles.speed_profile import (
    SpeedProfile,
    fastest_along,
    pieces_of,
    profile,
    seconds_at_any_speed,
)
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_names import VEHICLES, get_vehicle

WING, ROTOR = get_vehicle("fixed-wing"), get_vehicle("multirotor")
HOVERING = Vehicle(name="hovering", max_speed=15.0, max_roll=45.0, max_path_acceleration=4.0)
LINE = [[[0, 0], [9, 0], [9, 0], [9, 0]]]


def winding(number: int, seed: int) -> Array:
    """A chain of smooth segments of about 8 m."""
    rng = np.random.default_rng(seed)
    heading = np.cumsum(rng.normal(size=number + 1) * 0.5)
    points = np.cumsum(8.0 * np.stack([np.cos(heading), np.sin(heading)], axis=1), axis=0)
    slopes = np.gradient(points, axis=0)
    return np.stack([points[:-1], points[1:], slopes[:-1], slopes[1:]], axis=1)


def assert_possible(found: SpeedProfile, steps: Array, bends: Array, vehicle: Vehicle) -> None:
    """All limits hold on all pieces, where u changes linearly."""
    squares = found.speed**2
    most = np.maximum(squares[1:], squares[:-1])
    along, across = np.diff(squares) / (2.0 * steps), bends * most
    slack = 1.0 + 1e-9
    assert (found.speed <= vehicle.max_speed * slack).all()
    assert (found.speed >= vehicle.min_speed / slack).all()
    assert (across <= vehicle.max_lateral * slack).all()
    if vehicle.max_path_acceleration is not None:
        assert (np.abs(along) <= vehicle.max_path_acceleration * slack).all()
    if vehicle.max_acceleration is not None:
        assert (np.hypot(along, across) <= vehicle.max_acceleration * slack).all()


@pytest.mark.parametrize("vehicle", [HOVERING, ROTOR], ids=lambda one: one.name)
def test_times_converge_in_first_order(vehicle: Vehicle) -> None:
    """Each halving saves half of what the one before it saved."""
    control = winding(6, 0)
    times = [profile(*pieces_of(control, 2**k), vehicle, 1.0).seconds for k in range(5, 9)]
    saved = -np.diff(times)
    np.testing.assert_allclose(saved[1:] / saved[:-1], 0.5, atol=0.1)


@pytest.mark.parametrize("vehicle", [*VEHICLES.values(), HOVERING], ids=lambda one: one.name)
@pytest.mark.parametrize("seed", range(6))
def test_profiles_are_possible_and_finer_pieces_are_faster(vehicle: Vehicle, seed: int) -> None:
    control = winding(6, seed)
    times = list[float]()
    for number in (8, 32, 128):
        steps, bends = pieces_of(control, number)
        found = profile(steps, bends, vehicle, start_speed=vehicle.min_speed)
        times.append(found.seconds)
        if found.outcome.success:
            assert math.isnan(found.where)
            assert_possible(found, steps, bends, vehicle)
            assert times[-1] >= steps.sum() / vehicle.max_speed
        else:
            assert times[-1] == math.inf
    assert all(after <= before * (1.0 + 1e-9) for before, after in pairwise(times))
    best = fastest_along(control, vehicle, vehicle.min_speed)
    assert best.seconds <= times[1] * (1.0 + 1e-9)
    if best.outcome.success:
        assert best.seconds == pytest.approx(times[-1], rel=5e-3)


def test_straight_ahead_has_a_closed_form() -> None:
    found = fastest_along(LINE, WING)
    speed = math.sqrt(6.0**2 + 2.0 * 4.0 * 9.0)
    assert found.seconds == pytest.approx((speed - 6.0) / 4.0, rel=1e-9)
    assert found.speed[-1] == pytest.approx(speed)
    # without a limit of acceleration, top speed at once
    assert profile([9.0], [0.0], Vehicle(max_speed=3.0), 3.0).seconds == pytest.approx(3.0)


def test_a_circle_is_flown_at_the_speed_of_its_roll() -> None:
    """Up to it, the forward pass in total acceleration follows du/ds = 2 sqrt(A^2 - (u/R)^2)."""
    radius, number = 20.0, 20_000
    steps, bends = np.full(number, 200.0 / number), np.full(number, 1.0 / radius)
    wing = profile(steps, bends, WING)
    assert wing.speed[-1] == pytest.approx(math.sqrt(radius * WING.max_lateral))
    rotor = profile(steps, bends, ROTOR)
    # u = A R sin(2 s / R + phase), until u = A R
    full = ROTOR.max_acceleration * radius if ROTOR.max_acceleration else 0.0
    phase = math.asin(ROTOR.start_speed**2 / full)
    angle = np.minimum(2.0 * rotor.distance / radius + phase, math.pi / 2.0)
    np.testing.assert_allclose(rotor.speed**2, full * np.sin(angle), rtol=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_no_profile_of_the_same_pieces_is_faster(seed: int) -> None:
    """With a limit along the path, the greatest u is the solution of a linear program."""
    steps, bends = pieces_of(winding(5, seed), 8)
    found = profile(steps, bends, HOVERING, start_speed=1.0)
    caps = np.minimum(HOVERING.max_lateral / np.maximum(bends, 1e-12), HOVERING.max_speed**2)
    number = len(steps)
    rows = np.zeros((number, number + 1))
    rows[np.arange(number), np.arange(number)], rows[np.arange(number), 1 + np.arange(number)] = (
        -1,
        1,
    )
    slope = 2.0 * steps * (HOVERING.max_path_acceleration or 0.0)
    high = np.minimum(np.append(caps, np.inf), np.insert(caps, 0, np.inf))
    high[0] = 1.0
    best = linprog(
        -np.ones(number + 1),
        np.concatenate([rows, -rows]),
        np.concatenate([slope, slope]),
        bounds=np.stack([np.zeros(number + 1), high], axis=1),
    )
    np.testing.assert_allclose(found.speed**2, best.x, rtol=1e-6)


def test_braking_for_a_turn_begins_in_time() -> None:
    found = profile([10.0] * 6, [0.0] * 5 + [0.2], WING)
    assert found.speed[-1] ** 2 == pytest.approx(WING.max_lateral / 0.2)
    assert found.speed[-2] == found.speed[-1]
    assert found.speed[-3] ** 2 == pytest.approx(found.speed[-2] ** 2 + 80.0)


@pytest.mark.parametrize(
    ("bends", "vehicle", "start", "outcome", "where"),
    [
        ([0.0, 0.0, 0.3], WING, None, "too_steep", 20.0),
        ([0.3, 0.0, 0.0], WING, None, "too_steep", 0.0),
        ([0.2, 0.0, 0.0], WING, 15.0, "too_steep", 0.0),
        ([0.0, math.inf, 0.0], ROTOR, None, "too_hard", 10.0),
        ([0.0, 0.2, 0.0], WING, 15.0, "too_hard_along", 0.0),
        ([0.0, 4.0, 0.0], ROTOR, 15.0, "too_hard", 0.0),
    ],
)
def test_paths_that_cannot_be_flown_are_reported(
    bends: list[float], vehicle: Vehicle, start: float | None, outcome: str, where: float
) -> None:
    found = profile([10.0] * 3, bends, vehicle, start)
    assert (found.outcome.label, found.where, found.seconds) == (outcome, where, math.inf)


def test_a_cusp_cannot_be_flown_and_takes_no_long_search() -> None:
    cusp = [[[0, 0], [0, 1], [6, 6], [-6, 6]], [[0, 1], [0, 9], [-6, 6], [0, 9]]]
    assert fastest_along(cusp, WING).outcome.label == "too_steep"


def test_finer_pieces_leave_room_for_braking_from_the_start() -> None:
    """The curvature grows from zero; on few pieces it seems to begin at once."""
    bend = [[[0, 0], [6, 6], [6, 0], [6, 18]]]
    fast = Vehicle(max_speed=15.0, max_roll=60.0, max_path_acceleration=12.0)
    start = 10.15
    assert not profile(*pieces_of(bend, 16), fast, start).outcome.success
    assert fastest_along(bend, fast, start).outcome.success


def test_any_speed_gives_a_finite_time_to_what_cannot_be_flown() -> None:
    steps = [10.0] * 3
    flown = profile(steps, [0.0, 0.2, 0.0], WING)
    assert seconds_at_any_speed(steps, [0.0, 0.2, 0.0], WING) == flown.seconds
    times = [seconds_at_any_speed(steps, [0.0, bend, 0.0], WING) for bend in (0.2, 0.3, 3.0, 1e3)]
    assert times == sorted(times)
    assert times[-1] < math.inf
    assert seconds_at_any_speed(steps, [0.0, math.inf, 0.0], WING) == math.inf


def test_pieces_have_the_length_and_curvature_of_their_chain() -> None:
    control = winding(3, 0)
    steps, bends = pieces_of(control, 16)
    t = np.linspace(0.0, 1.0, 16 * 20 + 1)
    sampled = curvature(control, t)
    inside = np.stack([sampled[:, k : k + 21].max(axis=1) for k in range(0, 320, 20)], axis=1)
    assert (bends.reshape(3, 16) >= inside * (1.0 - 1e-9)).all()
    np.testing.assert_allclose(bends.reshape(3, 16), inside, rtol=0.02, atol=1e-3)
    points, _ = pieces_of(control, 1)
    assert steps.sum() == pytest.approx(points.sum(), rel=1e-9)


@pytest.mark.parametrize(
    ("steps", "bends", "message"),
    [
        ([], [], "at least one piece"),
        ([1.0, 0.0], [0.0, 0.0], "longer than 0 m"),
        ([1.0], [0.0, 0.0], "for each of 1 pieces"),
        ([1.0], [-1.0], "curvature of at least 0"),
        ([1.0], [math.nan], "curvature of at least 0"),
        ([math.inf], [0.0], "must be finite"),
    ],
)
def test_bad_pieces_are_refused(steps: ArrayLike, bends: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        profile(steps, bends, WING)


def test_bad_chains_are_refused() -> None:
    with pytest.raises(ValueError, match="a chain has shape"):
        fastest_along(LINE[0], WING)
    with pytest.raises(ValueError, match="a chain is planar here, got segments in 3 dimensions"):
        fastest_along(np.arange(12.0).reshape(1, 4, 3), WING)
    with pytest.raises(ValueError, match="segments 0 and 1 join with different directions"):
        fastest_along([LINE[0], [[9, 0], [9, 9], [0, 9], [0, 9]]], ROTOR)
    with pytest.raises(ValueError, match=r"segments 0 and 1 do not join: .* differ by 9 m"):
        fastest_along([LINE[0], LINE[0]], ROTOR)
    with pytest.raises(ValueError, match="an accuracy must be above 0"):
        fastest_along(LINE, WING, accuracy=0.0)
    with pytest.raises(ValueError, match="outside the speeds of fixed-wing"):
        fastest_along(LINE, WING, start_speed=1.0)
