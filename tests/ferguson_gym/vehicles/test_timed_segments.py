"""Certified speeds and accelerations of timed segments, compared with dense sampling."""

import math

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.vehicles.rate_kernels import FLOOR
from ferguson_gym.vehicles.timed_segments import Rates, acceleration, rates, velocity
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_names import get_vehicle
from ferguson_gym.vehicles.vehicle_outcome import FAILURES, VehicleOutcome
from tests.support.sampled_rates import sampled_rates, values

BEND = [[0, 0], [9, 3], [9, 0], [9, 6]]
LINE = [[0, 0], [9, 0], [9, 0], [9, 0]]
NAMES = ("least_speed", "greatest_speed", "across", "along", "acceleration")


def random_segments(rng: np.random.Generator, number: int) -> tuple[Array, Array]:
    """Of all kinds: smooth ones, and some with loops and nearly with cusps."""
    control = rng.normal(size=(number, 4, 2)) * rng.choice([1.0, 10.0, 100.0], (number, 1, 1))
    control[:, 1] = control[:, 0] + rng.normal(size=(number, 2)) * 8.0
    smooth = rng.random(number) < 0.5
    chord = (control[:, 1] - control[:, 0])[:, None]
    control[smooth, 2:] = (chord + 0.3 * rng.normal(size=(number, 2, 2)) * np.abs(chord))[smooth]
    return control, rng.uniform(0.2, 3.0, number)


def compare(number: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    control, duration = random_segments(rng, number)
    wind = rng.normal(size=2) * 3.0
    proved, sampled = rates(control, duration, wind), sampled_rates(control, duration, wind)
    rounding = 1e-11
    for name in NAMES[1:]:
        found, true = getattr(proved, name), sampled[name]
        assert (found >= true * (1.0 - rounding)).all(), name
        slack = FLOOR * proved.acceleration if name in ("across", "along") else 0.0
        # where the speed nearly vanishes, accelerations across and along are bounded by all of it
        regular = sampled["least_speed"] > 1e-5 * sampled["greatest_speed"]
        assert (found <= true * (1.0 + 1e-8) + slack)[regular].all(), name
    assert (proved.least_speed <= sampled["least_speed"]).all()
    pessimism = sampled["least_speed"] - proved.least_speed
    start, end, leave, arrive = control.transpose(1, 0, 2)
    middle = 3.0 * (end - start) - leave - arrive
    points = np.stack([leave, middle, arrive]) / duration[:, None] - wind
    assert (pessimism <= 1e-9 * np.linalg.norm(points, axis=-1).max(axis=0)).all()


def test_bounds_are_never_optimistic_and_hardly_pessimistic() -> None:
    compare(10_000, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 20))
def test_bounds_of_a_hundred_thousand_segments(seed: int) -> None:
    compare(10_000, seed)


def test_a_plain_grid_never_exceeds_the_bounds() -> None:
    control, duration = random_segments(np.random.default_rng(3), 500)
    proved, t = rates(control, duration), np.linspace(0.0, 1.0, 301)
    v, a = velocity(control, duration, t), acceleration(control, duration, t)
    speed = np.linalg.norm(v, axis=-1)
    own = values(control, duration, np.zeros(2), np.tile(t, (500, 1)))
    np.testing.assert_allclose(speed, own[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(a, axis=-1), own[3], rtol=1e-9, atol=1e-9)
    for name, sampled in zip(NAMES[1:], own, strict=True):
        assert (sampled.max(axis=1) <= getattr(proved, name) * (1.0 + 1e-12)).all(), name
    assert (speed.min(axis=1) >= proved.least_speed).all()


def test_longer_durations_and_other_scales_scale_the_rates() -> None:
    control, duration = random_segments(np.random.default_rng(5), 300)
    one = rates(control, duration)
    slower, larger = rates(control, 3.0 * duration), rates(3.0 * control, duration)
    same = rates(4.0 * control, 2.0 * duration)  # as gravity does
    for name in NAMES:
        power = 1 if "speed" in name else 2
        value, scale = getattr(one, name), getattr(one, "greatest_speed" if power == 1 else name)
        allowed = 3e-8 * (scale + FLOOR * one.acceleration) + 1e-9 * (power == 1)
        assert (np.abs(getattr(slower, name) * 3.0**power - value) <= allowed).all(), name
        assert (np.abs(getattr(larger, name) / 3.0 - value) <= allowed).all(), name
        factor = 2.0 if power == 1 else 1.0
        assert (np.abs(getattr(same, name) / factor - value) <= allowed).all(), name


def exactly(found: Rates, *expected: float) -> None:
    got = [float(getattr(found, name)) for name in NAMES]
    np.testing.assert_allclose(got, expected, rtol=1e-7, atol=1e-6)


def test_known_motions() -> None:
    exactly(rates(LINE, 1.5), 6.0, 6.0, 0.0, 0.0, 0.0)
    # from 2 to 4 m/s in 1 s, straight ahead
    exactly(rates([[0, 0], [3, 0], [2, 0], [4, 0]], 1.0), 2.0, 4.0, 0.0, 2.0, 2.0)
    # a stop at the end, and turning back: the velocity vanishes, and the total bounds all
    exactly(rates([[0, 0], [2, 0], [4, 0], [0, 0]], 1.0), 0.0, 4.0, 4.0, 4.0, 4.0)
    exactly(rates([[0, 0], [0, 0], [4, 0], [-4, 0]], 1.0), 0.0, 4.0, 8.0, 8.0, 8.0)
    exactly(rates(np.zeros((4, 2)), 1.0), 0.0, 0.0, 0.0, 0.0, 0.0)
    # a throw: constant acceleration across at its top
    exactly(rates([[0, 0], [2, 0], [2, 1], [2, -1]], 1.0), 2.0, math.sqrt(5), 2.0, 0.894427, 2.0)


def test_wind_is_subtracted_from_the_velocity() -> None:
    exactly(rates(LINE, 1.0, [4, 0]), 5.0, 5.0, 0.0, 0.0, 0.0)
    exactly(rates(LINE, 1.0, [9, 2]), 2.0, 2.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("control", "duration", "outcome"),
    [
        (LINE, 1.0, "within_limits"),
        (LINE, 1.6, "too_slow"),
        (LINE, 0.5, "too_fast"),
        ([[0, 0], [6, 6], [9, 0], [0, 9]], 1.0, "too_steep"),
        (BEND, 1.0, "within_limits"),
        ([[0, 0], [11, 0], [8, 0], [14, 0]], 1.0, "too_hard_along"),
    ],
)
def test_the_first_limit_that_is_broken_is_named(
    control: ArrayLike, duration: float, outcome: str
) -> None:
    wing, found = get_vehicle("fixed-wing"), rates(control, duration)
    assert found.outcome(wing).label == outcome
    assert (found.margin(wing) >= 0.0) == (outcome == "within_limits")
    both = rates([LINE, control], [1.0, duration])
    assert both.outcome(wing).label == outcome
    assert both.ratios(wing).shape == (2, 5)


def test_total_acceleration_and_what_has_no_limit() -> None:
    rotor = get_vehicle("multirotor")
    stop = rates([[0, 0], [2, 0], [4, 0], [0, 0]], 1.0)
    assert stop.outcome(rotor) is VehicleOutcome.WITHIN_LIMITS
    np.testing.assert_allclose(stop.ratios(rotor), [0, 4 / 15, 0, 0, 0.5], rtol=1e-7)
    assert rates([[0, 0], [2, 0], [4, 0], [0, 0]], 0.6).outcome(rotor) is VehicleOutcome.TOO_HARD
    slow = Vehicle(min_speed=1.0, max_speed=9.0)
    assert stop.margin(slow) == -np.inf
    assert stop.outcome(slow) is VehicleOutcome.TOO_SLOW


def test_the_paper_s_roll_is_that_of_a_coordinated_turn() -> None:
    """A short arc of 20 m radius at 12 m/s: the cubic is nearly a circle."""
    angle, radius, speed = 0.02, 20.0, 12.0
    end = radius * np.array([np.sin(angle), 1.0 - np.cos(angle)])
    reach = 4.0 * math.tan(angle / 4.0) * radius
    control = [[0, 0], end, [reach, 0], reach * np.array([np.cos(angle), np.sin(angle)])]
    found = rates(control, radius * angle / speed)
    roll = math.degrees(math.atan(float(found.across) / 9.81))
    assert roll == pytest.approx(math.degrees(math.atan(speed**2 / radius / 9.81)), rel=1e-4)


def test_codes_and_names_are_stable() -> None:
    assert [(one.code, one.label) for one in VehicleOutcome] == [
        (0, "within_limits"),
        (1, "too_slow"),
        (2, "too_fast"),
        (3, "too_steep"),
        (4, "too_hard_along"),
        (5, "too_hard"),
    ]
    assert len(FAILURES) == 5


@pytest.mark.parametrize(
    ("control", "duration", "message"),
    [
        (BEND, 0.0, "a duration must be above 0 s, got 0 s"),
        (BEND, -1.0, "a duration must be above 0 s, got -1 s"),
        (BEND, math.nan, "durations must be finite"),
        (BEND, math.inf, "durations must be finite"),
        ([BEND, BEND], [1.0, 1.0, 1.0], r"durations of shape \(3,\) do not belong to.*\(2,\)"),
        (BEND, "long", "durations must be an array of numbers"),
        (np.zeros((4, 3)), 1.0, "timed segments are planar, got segments in 3 dimensions"),
        ([[0, 0]], 1.0, "a control array has shape"),
    ],
)
def test_bad_input_is_refused(control: ArrayLike, duration: ArrayLike, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rates(control, duration)


def test_bad_wind_is_refused() -> None:
    with pytest.raises(ValueError, match="wind must have shape"):
        rates(BEND, 1.0, [1, 2, 3])
