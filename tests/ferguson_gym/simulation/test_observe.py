from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation.observe import observe, observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world import transition
from ferguson_gym.world.field_names import get_field


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"observation": "rays"},
        {"observation": "both", "nearest": 3, "rays": 5, "view": 45.0},
        {"nearest": 60, "focus": 9.0, "segments": 9},
        {"rays": 5, "way": 6, "margin": 2.0, "view": 50.0},
    ],
    ids=["discs", "rays", "both", "other", "way"],
)
def test_observations_from_states_are_those_of_the_environment(
    arguments: dict[str, Any],
) -> None:
    env = ObstacleField(**arguments)
    field = get_field("sparse/train:3")
    shown, _ = env.reset(options={"field": field})
    expected, vehicles = [shown], [env.state]
    for turn in (0.0, 0.1, -0.05):
        shown, *_ = env.step(np.array([0.0, turn, 0.0, 0.0], np.float32))
        expected.append(shown)
        vehicles.append(env.state)
    assert vehicles[-1].segments == 3
    seen = observe(field, vehicles, Settings(**arguments))
    assert list(seen) == list(shown)
    for key, values in seen.items():
        np.testing.assert_array_equal(values, [one[key] for one in expected])


def test_no_states_give_empty_observations() -> None:
    field = get_field("sparse/train:3")
    seen = observe(field, [], Settings(way=2))
    assert seen["goal"].shape == (0, 3)
    assert seen["way"].shape == (0, 6)
    (only,) = observe(field, [transition.initial_state(field)], Settings())["goal"]
    assert only[0] > 0.0


def test_one_observation_equals_its_row_of_many() -> None:
    field = get_field("dense/train:3")
    settings = Settings(observation="both", nearest=5, rays=9, way=3)
    vehicles = [
        transition.State(np.array([10.0 * k, 3.0 * k]), np.array([7.0, k]), k) for k in range(8)
    ]
    together = observe(field, vehicles, settings)
    for k, vehicle in enumerate(vehicles):
        alone = observe_one(field, vehicle, settings)
        assert list(alone) == list(together)
        for key, value in alone.items():
            np.testing.assert_array_equal(value, together[key][k])
