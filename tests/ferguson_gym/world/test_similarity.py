"""The map between a field and its image of the paper's scale."""

from __future__ import annotations

import numpy as np
import pytest

from ferguson_gym.world import Field, Limits, Obstacles, get_field, initial_state
from ferguson_gym.world.similarity import similarity
from tests.support.scaled_fields import MOTIONS, Motion


@pytest.mark.parametrize("name", ["paper:1", "standard/train:0"])
def test_fields_of_the_papers_scale_are_their_own_image(name: str) -> None:
    assert similarity(get_field(name)) is None


@pytest.mark.parametrize("motion", list(MOTIONS.values())[:4], ids=list(MOTIONS)[:4])
def test_the_image_of_a_moved_and_scaled_field_is_the_field(motion: Motion) -> None:
    field = get_field("dense/train:0")
    found = similarity(motion.field(field))
    assert found is not None
    image = found.image
    assert image.limits.longest == 15.0
    np.testing.assert_array_equal(image.start, [0.0, 0.0])
    assert image.obstacles.are_discs
    assert field.obstacles.are_discs
    np.testing.assert_allclose(image.obstacles.centers, field.obstacles.centers, atol=1e-8)
    np.testing.assert_allclose(image.obstacles.radii, field.obstacles.radii, rtol=1e-12)
    np.testing.assert_allclose(image.goal, field.goal, atol=1e-8)
    np.testing.assert_allclose(image.bounds, field.bounds, atol=1e-8)
    np.testing.assert_allclose(image.departure, field.departure, rtol=1e-12)
    np.testing.assert_allclose(image.limits.numbers(), field.limits.numbers(), rtol=1e-12)


def test_segments_and_states_come_back() -> None:
    field = Motion(7.3, (1e3, 2e3)).field(get_field("paper:1"))
    found = similarity(field)
    assert found is not None
    stream = np.random.default_rng(0)
    control = stream.normal(size=(5, 4, 2)) * 100.0 + 1e3
    np.testing.assert_allclose(found.control_back(found.control(control)), control, rtol=1e-13)
    assert found.control(np.empty((0, 4, 2))).shape == (0, 4, 2)
    state = found.state(initial_state(field))
    np.testing.assert_array_equal(state.position, found.image.start)
    np.testing.assert_array_equal(state.derivative, found.image.departure)


def test_the_goal_comes_back_exactly() -> None:
    field = Field(
        name="far", obstacles=Obstacles.discs([], []), start=[0.1, 0.2], goal=[77.7, 33.3]
    )
    found = similarity(field)
    assert found is not None
    np.testing.assert_array_equal(found.points_back(found.points(field.goal)[None])[0], field.goal)
    end = found.points(np.stack([field.goal, field.start]))
    np.testing.assert_array_equal(found.points_back(end), [field.goal, field.start])


def test_limits_of_the_field_are_kept_in_proportion() -> None:
    limits = Limits(longest=150.0, gate=3.0, tolerance=1e-3, segments=77)
    field = Field(
        name="big",
        obstacles=Obstacles.discs([], []),
        goal=[1000.0, 1000.0],
        limits=limits,
        bounds=(-100.0, 1100.0),
    )
    found = similarity(field)
    assert found is not None
    inside = found.image.limits
    np.testing.assert_allclose(inside.numbers(), (3.0, 15.0, 0.1, 0.3, 1e-4, 77), rtol=1e-12)
