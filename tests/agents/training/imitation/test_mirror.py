"""Mirror images of observations and actions equal those of a mirrored field."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from agents.training.imitation.mirror import mirrored
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.actions import decode
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State

KINDS: list[dict[str, Any]] = [
    {"observation": "discs", "nearest": 5},
    {"observation": "discs", "nearest": 40, "focus": 8.0},
    {"observation": "rays", "rays": 9},
    {"observation": "rays", "rays": 64},
    {"observation": "both", "nearest": 16, "focus": 10.0, "rays": 7},
    {"observation": "both", "nearest": 12, "rays": 8, "view": 15.0},
    {"rays": 9, "way": 5},
]


def flipped(field: Field) -> Field:
    discs = field.obstacles
    assert discs.are_discs
    return Field(name="mirror", obstacles=Obstacles.discs(discs.centers[:, ::-1], discs.radii))


def states(number: int) -> list[State]:
    stream = np.random.default_rng(3)
    return [
        State(stream.uniform(-10.0, 110.0, 2), stream.normal(size=2) * 6.0, int(k) % 41)
        for k in range(number)
    ]


def image_of(vehicle: State) -> State:
    return State(vehicle.position[::-1].copy(), vehicle.derivative[::-1].copy(), vehicle.segments)


def tensors(seen: Observation) -> dict[str, Any]:
    return {key: torch.from_numpy(value.copy()) for key, value in seen.items()}


@pytest.mark.parametrize("arguments", KINDS, ids=lambda kind: "-".join(map(str, kind.values())))
def test_what_is_seen_in_the_mirrored_field_is_the_mirrored_observation(
    arguments: dict[str, Any],
) -> None:
    settings, field = Settings(**arguments), get_field("standard/train:7")
    vehicles = states(60)
    seen = tensors(observe(field, vehicles, settings))
    there = observe(flipped(field), [image_of(one) for one in vehicles], settings)
    image, _ = mirrored(seen, torch.zeros(60, 4))
    assert list(image) == list(there)
    for key, value in there.items():
        # headings are computed from other sums: the last bits of single precision differ
        np.testing.assert_allclose(image[key], value, atol=3e-4 if key == "rays" else 2e-6)
        # and it is not as if nothing had happened
        assert key == "mask" or not np.allclose(seen[key], value, atol=1e-2)


def segment(action: Array, vehicle: State) -> Array:
    goal = np.array([100.0, 100.0])
    return decode(action, vehicle.position, vehicle.derivative, goal, 1.0)


def test_the_mirrored_action_flies_the_mirrored_segment() -> None:
    actions = np.random.default_rng(4).uniform(-1.0, 1.0, (60, 4)).astype(np.float32)
    _, image = mirrored({}, torch.from_numpy(actions))
    for vehicle, action, there in zip(states(60), actions, image.numpy(), strict=True):
        np.testing.assert_allclose(
            segment(there, image_of(vehicle)), segment(action, vehicle)[:, ::-1], atol=1e-9
        )


@pytest.mark.parametrize("arguments", KINDS, ids=lambda kind: "-".join(map(str, kind.values())))
def test_twice_mirrored_is_the_original(arguments: dict[str, Any]) -> None:
    seen = tensors(observe(get_field("dense/train:1"), states(20), Settings(**arguments)))
    actions = torch.rand(20, 4) * 2.0 - 1.0
    before = {key: value.clone() for key, value in seen.items()}
    again, back = mirrored(*mirrored(seen, actions))
    assert torch.equal(back, actions)
    for key, value in before.items():
        assert torch.equal(again[key], value)
        assert torch.equal(seen[key], value)  # what was handed in is as it was
