"""The compiled step against the plain one: outcomes, rewards and what a flight sums up."""

from typing import Any

import numpy as np
import pytest

from ferguson_gym.simulation.step_kernel import first_invalid
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.actions import decode, encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.suites import SUITES, suite_field
from ferguson_gym.world.transition import Step, advance

NUMBER = 40
OUTCOMES = {outcome for outcome in Outcome if outcome is not Outcome.GAVE_UP}


def drawn_field(suite: str, seed: int) -> Field:
    """A suite's discs; for odd seeds start and goal lie elsewhere, not far from each other."""
    field = suite_field(suite, "validation", seed)
    if seed % 2 == 0:
        return field
    stream = np.random.default_rng(seed)
    points = stream.uniform(-8.0, 108.0, (999, 2))
    start, *others = points[(field.obstacles.signed_distance(points) > 0.5).all(axis=-1)]
    goal = min(others, key=lambda point: abs(np.hypot(*(point - start)) - 11.0))
    way = 12.0 * (goal - start) / np.hypot(*(goal - start))
    bounds = np.array([[-9.0, -8.5], [109.0, 111.0]])
    return Field(
        name=f"{suite} {seed}",
        obstacles=field.obstacles,
        start=start,
        goal=goal,
        bounds=bounds,
        start_derivative=way,
    )


def drawn(stream: np.random.Generator, envs: VectorObstacleField) -> np.ndarray:
    """Actions: small, large, straight to the goal, some that are short or end in a standstill."""
    spread = stream.choice([0.03, 0.15, 1.0], (NUMBER, 1), p=[0.6, 0.3, 0.1])
    actions = (stream.uniform(-1.0, 1.0, (NUMBER, 4)) * spread).astype(np.float32)
    for i in range(NUMBER):
        state, goal = envs.state(i), envs.field(i).goal
        place = state.position, state.derivative
        segment = decode(actions[i], *place, goal, 0.0)
        if (chance := stream.random()) < 0.03:
            segment[3] = 0.0
        elif chance < 0.08:
            forward = state.derivative / np.hypot(*state.derivative)
            segment[1], segment[3] = state.position + 2.0 * forward, forward
        elif np.hypot(*(goal - state.position)) < 14.0:
            segment[1], segment[3] = goal, 9.0 * (goal - state.position) / 11.0
        else:
            continue
        actions[i] = encode(segment, *place)
    return actions


def expected_reward(field: Field, before: np.ndarray, step: Step, detour: float, failure: float):
    gained = 0.0
    if step.flown:
        to_goal = [np.hypot(*(field.goal - where)) for where in (before, step.state.position)]
        progress = to_goal[0] - to_goal[1]
        gained = (progress - detour * (step.inspection.length - progress)) / field.distance
    ended_badly = step.outcome not in (Outcome.FLYING, Outcome.GOAL_REACHED)
    return float(gained) - failure * ended_badly


@pytest.mark.parametrize("suite", SUITES)
def test_steps_are_those_of_the_plain_function(suite: str) -> None:
    arguments: dict[str, Any] = {"gate": 1.5, "segments": 6, "detour": 0.8, "failure": 0.6}
    envs = VectorObstacleField(
        NUMBER, autoreset_mode="Disabled", suite=suite, fields=1, capacity=180, **arguments
    )
    stream, outcomes = np.random.default_rng(1), set()
    fields = [drawn_field(suite, seed) for seed in range(NUMBER)]
    _, infos = envs.reset(options={"field": fields})
    clearance = np.array([f.obstacles.signed_distance(f.start).min() for f in fields])
    np.testing.assert_allclose(infos["clearance"], clearance, rtol=0, atol=1e-9)
    at_start, length = clearance.copy(), np.zeros(NUMBER)
    for _ in range(25):
        states = [envs.state(i) for i in range(NUMBER)]
        flown = [envs.control(i) for i in range(NUMBER)]
        actions = drawn(stream, envs)
        _, reward, terminated, truncated, infos = envs.step(actions)
        for i, (field, state) in enumerate(zip(fields, states, strict=True)):
            limited = envs.field(i)
            assert (limited.limits.gate, limited.limits.segments) == (1.5, 6)
            step = advance(limited, state, actions[i])
            outcomes.add(step.outcome)
            assert Outcome.from_code(infos["outcome"][i]) is step.outcome
            assert infos["is_success"][i] == (step.outcome is Outcome.GOAL_REACHED)
            assert truncated[i] == (step.outcome is Outcome.OUT_OF_SEGMENTS)
            assert (terminated[i] | truncated[i]) == (step.outcome is not Outcome.FLYING)
            assert not (terminated[i] & truncated[i])
            after = envs.state(i)
            np.testing.assert_array_equal(after.position, step.state.position)
            np.testing.assert_array_equal(after.derivative, step.state.derivative)
            assert infos["segments"][i] == after.segments == step.state.segments
            expected = expected_reward(field, state.position, step, 0.8, 0.6)
            assert reward[i] == pytest.approx(expected, abs=1e-12)
            if step.flown:
                clearance[i] = min(clearance[i], step.inspection.clearance)
                length[i] += step.inspection.length
                flown[i] = np.concatenate([flown[i], step.control[None]])
                assert envs.refused(i) is None
            else:
                np.testing.assert_array_equal(envs.refused(i), step.control)
            np.testing.assert_array_equal(envs.control(i), flown[i])
        np.testing.assert_allclose(infos["clearance"], clearance, rtol=0, atol=1e-9)
        np.testing.assert_allclose(infos["path_length"], length, rtol=1e-12, atol=1e-12)
        if (over := terminated | truncated).any():
            envs.reset(options={"field": fields, "reset_mask": over})
            clearance[over], length[over] = at_start[over], 0.0
    assert outcomes == OUTCOMES


def test_without_obstacles_the_clearance_is_infinite() -> None:
    envs = VectorObstacleField(2, obstacles=0, fields=1)
    _, infos = envs.reset(seed=0)
    assert infos["clearance"].tolist() == [np.inf, np.inf]
    *_, infos = envs.step(np.zeros((2, 4), np.float32))
    assert infos["clearance"].tolist() == [np.inf, np.inf]
    assert infos["outcome"].tolist() == [0, 0]


def test_a_field_that_was_flown_before_leaves_no_disc_behind() -> None:
    many, few = (
        suite_field("forest", "train", 0),
        Field(name="few", obstacles=Obstacles.discs([[9, 60]], [1])),
    )
    envs = VectorObstacleField(1, capacity=180, fields=1, observation="discs")
    envs.reset(options={"field": many})
    seen, infos = envs.reset(options={"field": few})
    assert infos["clearance"][0] == np.hypot(9.0, 60.0) - 1.0
    assert seen["mask"].sum() == 0.0


@pytest.mark.parametrize(
    ("value", "bad"),
    [
        (1.0, False),
        (-1.0, False),
        (np.nextafter(np.float32(1), np.float32(2)), True),
        (np.nan, True),
        (np.inf, True),
        (-np.inf, True),
    ],
)
def test_the_first_invalid_action_is_found_wherever_it_is(value: float, bad: bool) -> None:
    for row in range(3):
        for column in range(4):
            actions = np.zeros((3, 4), np.float32)
            actions[row, column] = value
            assert first_invalid(actions) == (row if bad else -1)
            actions[2, 3] = value
            assert first_invalid(actions) == (row if bad else -1)
