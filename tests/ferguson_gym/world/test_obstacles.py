"""Obstacles among many: what is looked up by coordinates is what a look at every one finds."""

import pickle

import numpy as np
import pytest
from numba import typeof

from ferguson_gym.curves import clearance
from ferguson_gym.world import obstacles
from ferguson_gym.world.obstacles import Obstacles


@pytest.fixture(autouse=True)
def _few_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every field has many discs."""
    monkeypatch.setattr(obstacles, "MANY", 0)


def scattered(seed: int, number: int, dimension: int = 2) -> Obstacles:
    """Discs or balls of sizes from 0.1 to 10 m, and one of 40 m."""
    stream = np.random.default_rng(seed)
    radii = 10.0 ** stream.uniform(-1.0, 1.0, number)
    radii[0] = 40.0
    return Obstacles.discs(stream.uniform(-50.0, 250.0, (number, dimension)), radii)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("reach", [-1.0, 0.0, 5.0, 45.0, 1e3])
def test_the_discs_near_a_point_in_their_order(reach: float, dimension: int) -> None:
    discs = scattered(1, 300, dimension)
    for point in np.random.default_rng(2).uniform(-100.0, 300.0, (20, dimension)):
        near, keep = discs.near(point, reach), discs.signed_distance(point) <= reach
        np.testing.assert_array_equal(near.centers, discs.centers[keep])
        np.testing.assert_array_equal(near.radii, discs.radii[keep])


@pytest.mark.parametrize("number", [1, 5, 300])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0, 1e4])
def test_the_clearance_of_segments_near_and_far(number: int, scale: float) -> None:
    discs = scattered(3, number)
    control = np.random.default_rng(4).normal(size=(5, 6, 4, 2)) * scale
    control[..., :2, :] += 100.0
    expected = clearance(control, discs.centers, discs.radii)
    np.testing.assert_allclose(discs.clearance(control), expected, rtol=1e-12, atol=1e-12)
    each = [discs.clearance(segment) for segment in control.reshape(-1, 4, 2)]
    np.testing.assert_allclose(each, expected.ravel(), rtol=1e-12, atol=1e-12)


def test_no_segments_and_segments_of_another_dimension() -> None:
    discs = scattered(5, 10)
    assert discs.clearance(np.empty((0, 4, 2))).shape == (0,)
    with pytest.raises(ValueError, match="centers"):
        discs.clearance(np.zeros((4, 3)))


def test_they_travel_to_other_processes() -> None:
    discs = scattered(6, 50)
    discs.near([0.0, 0.0], 10.0)
    copy = pickle.loads(pickle.dumps(discs))
    np.testing.assert_array_equal(copy.near([9.0, 9.0], 60.0).radii, discs.near([9, 9], 60).radii)


def test_kernels_are_compiled_once_for_discs_and_other_shapes() -> None:
    discs = Obstacles.discs([[0.0, 0.0]], [1.0])
    shapes = Obstacles.joined([discs, Obstacles.boxes([[3.0, 3.0]], [[4.0, 4.0]])])
    types = [[typeof(array) for array in (*some.balls, *some.cores)] for some in (discs, shapes)]
    assert types[0] == types[1]
