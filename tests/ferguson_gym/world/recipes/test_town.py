"""Towns: what is built where, and that streets lead through."""

import numpy as np
import pytest
from scipy import ndimage

from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.world.field import from_json, to_json
from ferguson_gym.world.recipes.town import MOST
from ferguson_gym.world.suites import SPLITS, suite_field


@pytest.mark.parametrize("split", SPLITS)
def test_every_town_follows_its_recipe(split):
    kinds = set()
    for seed in range(60):
        field = suite_field("town", split, seed)
        obstacles, number = field.obstacles, np.diff(field.obstacles.starts)
        assert 20 <= len(obstacles) <= MOST
        assert set(number.tolist()) <= {1, 4}
        kinds |= set(zip(number.tolist(), (obstacles.radii > 0.0).tolist(), strict=True))
        reach = np.repeat(obstacles.radii, number)[:, None]
        assert (obstacles.points - reach).min() >= -4.0
        assert (obstacles.points + reach).max() <= 104.0
        ends = np.array([field.start, field.goal])
        assert obstacles.signed_distance(ends).min() >= 6.0
        assert obstacles.radii[number == 1].min(initial=1.0) >= 0.5  # trees
    assert kinds == {(1, True), (4, False), (4, True)}  # trees, buildings, rounded ones


@pytest.mark.parametrize("seed", range(4))
def test_streets_lead_through_the_town(seed):
    field = suite_field("town", "validation", seed)
    assert leads_through(field, 2.0)
    assert 100.0 * 2.0**0.5 <= exact_length(field) < 160.0


def test_buildings_are_rectangles_of_one_town_or_askew_in_their_blocks():
    for seed in range(20):
        obstacles = suite_field("town", "train", seed).obstacles
        rectangles = obstacles.only(np.diff(obstacles.starts) == 4).points.reshape(-1, 4, 2)
        sides = np.roll(rectangles, -1, axis=1) - rectangles
        np.testing.assert_allclose(sides[:, 0], -sides[:, 2], atol=1e-12)
        along, across = sides[:, 0], sides[:, 1]
        assert (along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0] > 0.1).all()
        np.testing.assert_allclose((along * across).sum(axis=1), 0.0, atol=1e-11)
        turned = np.degrees(np.arctan2(along[:, 1], along[:, 0])) % 90.0
        turned = np.minimum(turned, 90.0 - turned)
        assert turned.max() <= 27.1 + 11.5


def test_fields_of_files_are_the_same_bit_for_bit(tmp_path):
    for suite in ("town", "walls"):
        field = suite_field(suite, "test", 3)
        to_json(field, tmp_path / "field.json")
        again = from_json(tmp_path / "field.json").obstacles
        for name in ("points", "radii", "first"):
            np.testing.assert_array_equal(getattr(again, name), getattr(field.obstacles, name))


def leads_through(field, room):
    """Whether points of a grid that keep this distance [m] join start and goal."""
    ticks = np.arange(-10.0, 110.1, 0.5)
    points = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1)
    distance = np.concatenate([field.obstacles.signed_distance(row).min(axis=-1) for row in points])
    parts, _ = ndimage.label(distance.reshape(len(ticks), -1) >= room)
    ends = [parts[20, 20], parts[220, 220]]
    return ends[0] == ends[1] > 0
