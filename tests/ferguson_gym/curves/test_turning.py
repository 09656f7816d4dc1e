"""Bending energy and the speed of turns, against closed forms and fine quadrature."""

import numpy as np
import pytest

from ferguson_gym.curves.splines import curvature, derivative, subdivide
from ferguson_gym.curves.turning import bending_energy, fastest_turn, tightest_turn

NODES, WEIGHTS = np.polynomial.legendre.leggauss(300)
LINE = np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 4.0]])


def arc(radius: float, pieces: int) -> np.ndarray:
    """A quarter of a circle: cubics with the handles of Bézier circles."""
    angles = np.linspace(0.0, np.pi / 2, pieces + 1)
    handle = 4.0 * np.tan(np.pi / (8 * pieces))
    points = radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    tangents = radius * handle * np.stack([-np.sin(angles), np.cos(angles)], axis=-1)
    return np.stack([points[:-1], points[1:], tangents[:-1], tangents[1:]], axis=1)


@pytest.mark.parametrize("radius", [0.5, 3.0, 40.0])
def test_bending_energy_of_an_arc_is_its_angle_over_its_radius(radius: float) -> None:
    energy = bending_energy(arc(radius, 16))
    assert energy.shape == (16,)
    assert energy.sum() == pytest.approx(np.pi / 2 / radius, rel=1e-7)


@pytest.mark.parametrize("derivatives", [(1.0, 1.0), (0.2, 2.5)])
def test_bending_energy_of_a_line_is_zero(derivatives: tuple[float, float]) -> None:
    line = LINE.copy()
    line[2:] *= np.array(derivatives)[:, None]
    assert bending_energy(line) == pytest.approx(0.0, abs=1e-12)


def test_bending_energy_of_a_cusp_is_infinite() -> None:
    assert bending_energy([[0, 0], [4, 3], [0, 0], [1, 5]]) == np.inf


@pytest.mark.parametrize("seed", range(8))
def test_bending_energy_agrees_with_fine_quadrature(seed: int) -> None:
    # end and derivatives near (10, 0): without a near-cusp that a fixed grid would miss
    ahead = np.random.default_rng(seed).normal([1.0, 0.0], 0.25, (3, 2))
    control = 10.0 * np.vstack([[[0.0, 0.0]], ahead])
    t = 0.5 * (NODES + 1.0)
    speed = np.linalg.norm(derivative(control, t), axis=-1)
    fine = 0.5 * WEIGHTS @ (curvature(control, t) ** 2 * speed)
    assert bending_energy(control) == pytest.approx(fine, rel=1e-8, abs=1e-12)


def test_bending_energy_adds_up_over_the_parts_of_a_nearly_cusped_segment() -> None:
    # the derivative falls to the least that may be flown, 0.1 m, near t = 1/2
    control = np.array([[0.0, 0.0], [3.0, 0.0], [9.0, 4.0], [8.6, -4.0]])
    whole = bending_energy(control)
    halves = [half for t in subdivide(control, 0.37) for half in subdivide(t, 0.71)]
    assert whole > 1.0
    assert bending_energy(np.stack(halves)).sum() == pytest.approx(whole, rel=1e-8)


def test_the_papers_example_is_just_over_seven_metres_a_second() -> None:
    assert 7.0 < fastest_turn(3.0) < 7.2
    # back through equation (1): R = v^2 / (g tan(roll))
    for radius, roll in ((3.0, np.pi / 3), (40.0, 0.4)):
        speed = fastest_turn(radius, roll)
        assert speed**2 / (9.81 * np.tan(roll)) == pytest.approx(radius, rel=1e-14)
        assert tightest_turn(speed, roll) == pytest.approx(radius, rel=1e-14)
    assert fastest_turn(np.inf) == np.inf
    assert fastest_turn(0.0) == 0.0


@pytest.mark.parametrize(
    ("radius", "roll", "message"),
    [
        (-1.0, 1.0, "a turn radius is at least 0 m, got -1"),
        (np.nan, 1.0, "a turn radius is at least 0 m, got nan"),
        (3.0, 0.0, "between 0 and pi/2, got 0"),
        (3.0, 1.6, "between 0 and pi/2, got 1.6"),
    ],
)
def test_invalid_turn_radii_are_refused(radius: float, roll: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        fastest_turn(radius, roll)


@pytest.mark.parametrize(
    ("speed", "roll", "message"),
    [
        (-1.0, 1.0, "a speed is at least 0 m/s, got -1"),
        (np.nan, 1.0, "a speed is at least 0 m/s, got nan"),
        (7.0, 0.0, "between 0 and pi/2, got 0"),
    ],
)
def test_invalid_speeds_are_refused(speed: float, roll: float, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tightest_turn(speed, roll)


def test_bending_energy_near_a_cusp_is_finite_without_a_warning() -> None:
    energy = bending_energy([[0.0, 0.0], [0.0, 0.0], [0.0, 1.0], [1e-9, 0.0]])
    assert 0.0 < energy < np.inf
