"""A flight scaled with its field has the same actions, observations and rewards."""

from __future__ import annotations

import numpy as np
import pytest

from ferguson_gym import Field, ObstacleField, VectorObstacleField, get_field
from ferguson_gym.world import Obstacles, advance, encode, fly_segment, initial_state
from planners.interface import initial_state as planner_state
from planners.registry import make
from tests.support.scaled_fields import MOTIONS, Motion

SCALES = [1e-3, 0.3048, 7.0, 1e4]


def flights(field: Field, moved: Field) -> tuple[ObstacleField, ObstacleField, list[np.ndarray]]:
    """Two environments, reset in a field and in its image, and the actions of a flight."""
    shown = {"observation": "both", "way": 6, "progress": "way", "reference": True}
    one, other = (ObstacleField(fields=1, **shown) for _ in range(2))
    one.reset(seed=0, options={"field": field})
    other.reset(seed=0, options={"field": moved})
    plan = make("pursuit").plan(field, planner_state(field), 0)
    actions = [
        encode(segment, segment[0], segment[2], field.limits.unit) for segment in plan.control
    ]
    return one, other, actions


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=list(MOTIONS))
def test_observations_rewards_and_infos_scale_with_the_field(motion: Motion) -> None:
    field = get_field("dense/train:2")
    moved = motion.field(field)
    one, other, actions = flights(field, moved)
    turned = motion.turn != ((1.0, 0.0), (0.0, 1.0))
    mirrored = np.linalg.det(np.array(motion.turn)) < 0.0
    for action in actions:
        twin = action * np.array([1, -1, 1, -1], np.float32) if mirrored else action
        seen, reward, *ended, info = one.step(action)
        image, scaled_reward, *scaled_ended, scaled_info = other.step(twin)
        assert ended == scaled_ended
        assert scaled_reward == pytest.approx(reward, abs=1e-6)
        assert scaled_info["segments"] == info["segments"]
        assert scaled_info["outcome"] == info["outcome"]
        for name in ("path_length", "clearance", "shortest"):
            assert scaled_info[name] == pytest.approx(motion.scale * info[name], rel=1e-6)
        if not turned:
            for key, values in seen.items():
                np.testing.assert_allclose(image[key], values, rtol=0, atol=2e-5, err_msg=key)
        elif mirrored:
            flip = np.append(np.tile([1.0, -1.0], 6), [1.0, 1.0])
            np.testing.assert_allclose(image["way"], flip * seen["way"], rtol=0, atol=2e-5)
        else:
            np.testing.assert_allclose(image["way"], seen["way"], rtol=0, atol=2e-5)
    assert info["is_success"]


@pytest.mark.parametrize("scale", SCALES)
def test_the_plain_step_scales_with_the_field(scale: float) -> None:
    field, motion = get_field("standard/train:3"), Motion(scale=scale)
    moved = motion.field(field)
    state, image = initial_state(field), initial_state(moved)
    stream = np.random.default_rng(0)
    for _ in range(200):
        action = stream.uniform(-0.3, 0.3, 4).astype(np.float32)
        step, other = advance(field, state, action), advance(moved, image, action)
        assert step.outcome is other.outcome
        np.testing.assert_allclose(
            other.control, scale * step.control, rtol=1e-9, atol=1e-9 * scale
        )
        again = fly_segment(moved, image, other.control)
        np.testing.assert_allclose(again.control, other.control, rtol=0, atol=4e-5 * scale)


def test_environments_side_by_side_have_fields_of_different_scales() -> None:
    field = get_field("sparse/train:1")
    fields = [field, Motion(scale=100.0).field(field), field.with_limits(longest=10.0)]
    envs = VectorObstacleField(3, autoreset_mode="Disabled", fields=fields)
    envs.reset(options={"field": fields})
    actions = np.zeros((3, 4), np.float32)
    _, rewards, _, _, infos = envs.step(actions)
    np.testing.assert_allclose(infos["path_length"], [9.0, 900.0, 6.0], rtol=1e-6)
    assert rewards[0] == pytest.approx(rewards[1])


def test_a_field_has_its_own_gate_and_number_of_segments() -> None:
    ahead = Field(
        name="ahead",
        obstacles=Obstacles.discs([], []),
        goal=[20.0, 0.0],
        limits={"gate": 2.5, "segments": 3},
    )
    env = ObstacleField(fields=1)
    env.reset(options={"field": ahead})
    env.step(np.zeros(4, np.float32))
    *_, info = env.step(np.zeros(4, np.float32))  # at 18 m, within the gate
    assert info["is_success"]
    other = ObstacleField(fields=1, gate=0.5, segments=2)
    other.reset(options={"field": ahead})
    other.step(np.zeros(4, np.float32))
    *_, truncated, info = other.step(np.zeros(4, np.float32))
    assert truncated
    assert not info["is_success"]
    assert (other.field.limits.gate, other.field.limits.segments) == (0.5, 2)


def test_long_fields_have_room_for_their_segments() -> None:
    far = Field(
        name="far", obstacles=Obstacles.discs([], []), goal=[1000.0, 0.0], bounds=(-10.0, 1010.0)
    )
    assert far.limits.segments == 283
    env = ObstacleField(fields=far)
    assert env.settings.max_segments == 283
    drawn = ObstacleField(fields=1)
    drawn.reset(options={"field": far})
    for _ in range(100):
        *_, info = drawn.step(np.zeros(4, np.float32))
    assert info["segments"] == 100
