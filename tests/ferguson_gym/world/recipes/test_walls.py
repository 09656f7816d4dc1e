"""Walls: corridors, doors and dead ends."""

import itertools

import numpy as np
import pytest

from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world.recipes.walls import MOST
from ferguson_gym.world.suites import SPLITS, suite_field
from tests.ferguson_gym.world.recipes.test_town import leads_through


@pytest.mark.parametrize("split", SPLITS)
def test_every_field_of_walls_follows_its_recipe(split):
    longest = []
    for seed in range(60):
        field = suite_field("walls", split, seed)
        obstacles = field.obstacles
        assert 20 <= len(obstacles) <= MOST
        assert (np.diff(obstacles.starts) == 2).all()
        assert obstacles.radii.min() >= 0.3
        assert obstacles.radii.max() <= 0.7
        assert obstacles.points.min() >= -10.0 - 1e-9
        assert obstacles.points.max() <= 110.0 + 1e-9
        ends = np.array([field.start, field.goal])
        assert obstacles.signed_distance(ends).min() >= 6.0
        lengths = np.linalg.norm(obstacles.points[1::2] - obstacles.points[::2], axis=1)
        assert lengths.min() >= 1.5
        longest.append(lengths.max())
    assert min(longest) > 20.0


@pytest.mark.parametrize("seed", range(4))
def test_doors_lead_from_start_to_goal_but_not_straight(seed):
    field = suite_field("walls", "validation", seed)
    assert leads_through(field, 2.0)
    assert 100.0 * 2.0**0.5 < exact_length(field) < 190.0
    straight = np.linspace(field.start, field.goal, 2000)
    assert field.obstacles.signed_distance(straight).min() < 0.0


def test_walls_begin_and_end_at_other_walls_doors_or_bounds():
    for seed in range(10):
        obstacles = suite_field("walls", "train", seed).obstacles
        ends = obstacles.points.reshape(-1, 2, 2)
        joined = 0
        for k, end in itertools.product(range(len(ends)), range(2)):
            others = np.delete(obstacles.signed_distance(ends[k, end]), k)
            on_bound = np.isin(ends[k, end], (-10.0, 110.0)).any()
            joined += bool(on_bound or others.min() < 0.0)
        # both ends of a wall are joined to something; pieces between two doors have free ends
        assert joined >= len(ends) * 0.6
