"""Points of a path at given distances along it."""

from __future__ import annotations

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import path_from, shortest_path
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles


@pytest.mark.parametrize("name", ["paper:2", "dense/train:1", "traps/train:2"])
def test_points_at_distances_are_those_of_a_fine_sampling(name: str) -> None:
    path = shortest_path(get_field(name))
    assert path is not None
    assert len(path.discs) > 1
    sampled = path.points(1e-3)
    chords = np.linalg.norm(np.diff(sampled, axis=0), axis=1)
    along = np.append(0.0, np.cumsum(chords))
    assert along[-1] == pytest.approx(path.length, abs=1e-5)
    distances = np.linspace(0.0, path.length, 301)
    expected = np.stack([np.interp(distances, along, axis) for axis in sampled.T], axis=1)
    np.testing.assert_allclose(path.at(distances), expected, rtol=0, atol=1e-5)


def test_points_before_and_beyond_a_path_are_its_ends() -> None:
    field = Field(name="one", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0]))
    path = shortest_path(field)
    assert path is not None
    ends = path.at(np.array([-1.0, 0.0, path.length, path.length + 5.0]))
    np.testing.assert_allclose(ends, [field.start] * 2 + [field.goal] * 2, rtol=0, atol=1e-9)
    assert path.at(np.array([])).shape == (0, 2)


def test_pieces_of_length_zero_are_points() -> None:
    field = Field(name="one", obstacles=Obstacles.discs([[50.0, 50.0]], [10.0]))
    at_goal = path_from(field, field.goal)
    assert at_goal is not None
    np.testing.assert_array_equal(at_goal.at(np.array([0.0, 1.0])), [field.goal] * 2)
    # from a point on the disc the first line has no length
    on_disc = path_from(field, [50.0 - np.sqrt(50.0), 50.0 - np.sqrt(50.0)])
    assert on_disc is not None
    places = on_disc.at(np.array([0.0, 0.1, 1.0]))
    assert np.isfinite(places).all()
    np.testing.assert_allclose(np.hypot(*(places - 50.0).T), 10.0, rtol=0, atol=1e-7)
