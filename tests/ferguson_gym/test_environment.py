"""The Gymnasium environment: its contract, reward, infos and pictures."""

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hypothesis import given, settings
from hypothesis import strategies as st

import ferguson_gym
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.environment import ObstacleField
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.suites import suite_field

STILL = np.zeros(4, np.float32)
OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


def fly(env: ObstacleField, actions: list[np.ndarray]) -> tuple[float, bool, bool, dict]:
    """Fly actions to the end; returns the return, terminated, truncated and the last info."""
    total, terminated, truncated, info = 0.0, False, False, {}
    for action in actions:
        _, reward, terminated, truncated, info = env.step(action)
        total += reward
        if terminated or truncated:
            break
    return total, terminated, truncated, info


def toward(env: ObstacleField, end: np.ndarray, derivative: np.ndarray) -> np.ndarray:
    state = env.state
    segment = np.array([state.position, end, state.derivative, derivative])
    return encode(segment, state.position, state.derivative)


@pytest.mark.parametrize("suite", ["standard", "sparse", "forest"])
@pytest.mark.parametrize("render_mode", [None, "rgb_array"])
def test_gymnasiums_checker_passes(suite: str, render_mode: str | None) -> None:
    env = gym.make(ENVIRONMENT_ID, suite=suite, observation="both", render_mode=render_mode)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


def test_stable_baselines_checker_passes() -> None:
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gym.make(ENVIRONMENT_ID))


def test_make_by_the_registered_name_and_again_from_its_spec() -> None:
    env = gym.make(ENVIRONMENT_ID, suite="traps", split="validation", rays=5)
    assert env.spec is not None
    again = gym.make(env.spec)
    first, _ = env.reset(seed=4)
    second, _ = again.reset(seed=4)
    assert again.unwrapped.field.name == "traps/validation:4"
    for key, value in first.items():
        np.testing.assert_array_equal(value, second[key])


def test_a_seed_flies_its_field_and_later_resets_draw_their_own() -> None:
    env = ObstacleField()
    env.reset(seed=7)
    assert env.field.name == "standard/train:7"
    drawn = []
    for _ in range(3):
        env.reset()
        drawn.append(env.field.name)
    assert len({*drawn, "standard/train:7"}) == 4
    other = ObstacleField()
    other.reset(seed=7)
    for name in drawn:
        other.reset()
        assert other.field.name == name


def test_a_given_field_is_flown_by_value_or_by_name() -> None:
    env = ObstacleField()
    field = suite_field("dense", "test", 1)
    env.reset(options={"field": field})
    assert env.field is field
    env.reset(options={"field": "paper:3"})
    assert env.field.name == "paper:3"


def test_straight_flight_over_an_open_field_reaches_the_goal() -> None:
    env = ObstacleField()
    env.reset(options={"field": OPEN})
    before, *_ = fly(env, [STILL] * 15)
    last, terminated, truncated, info = fly(env, [toward(env, OPEN.goal, np.array([5.0, 5.0]))])
    assert terminated
    assert not truncated
    assert info["is_success"]
    assert info["outcome"] == Outcome.GOAL_REACHED.code
    assert info["segments"] == 16
    assert info["path_length"] == pytest.approx(OPEN.distance)
    assert before + last == pytest.approx(1.0)


@pytest.mark.parametrize("detour", [0.0, 1.0, 2.5])
def test_successful_flights_return_one_less_the_detour_penalty(detour: float) -> None:
    env = ObstacleField(detour=detour)
    env.reset(options={"field": OPEN})
    corners = [np.array([8.0 * k, 8.0 * k + 3.0 * (k % 2)]) for k in range(1, 13)]
    corners.append(OPEN.goal)
    actions_return = 0.0
    for corner in corners:
        _, reward, terminated, _, info = env.step(toward(env, corner, np.array([8.0, 8.0])))
        actions_return += reward
    assert terminated
    assert info["is_success"]
    assert info["path_length"] > OPEN.distance
    excess = info["path_length"] / OPEN.distance - 1.0
    assert actions_return == pytest.approx(1.0 - detour * excess)


@given(seed=st.integers(0, 10_000), spread=st.sampled_from([0.05, 0.2, 1.0]))
@settings(deadline=None, max_examples=60, derandomize=True)
def test_returns_are_what_the_formula_says(seed: int, spread: float) -> None:
    env = ObstacleField(suite="sparse", detour=0.7, failure=0.4)
    env.reset(seed=seed)
    stream = np.random.default_rng(seed)
    actions = [stream.uniform(-spread, spread, 4).astype(np.float32) for _ in range(40)]
    total, _, _, info = fly(env, actions)
    distance = env.field.distance
    progress = distance - np.linalg.norm(env.field.goal - env.state.position)
    expected = (progress - 0.7 * (info["path_length"] - progress)) / distance
    assert total == pytest.approx(expected - (0.0 if info["is_success"] else 0.4), abs=1e-9)
    assert info["is_success"] == (progress == distance)


@given(seed=st.integers(0, 10_000))
@settings(deadline=None, max_examples=40, derandomize=True)
def test_observations_stay_in_their_space_and_steps_repeat(seed: int) -> None:
    env, twin = ObstacleField(suite="dense"), ObstacleField(suite="dense")
    stream = np.random.default_rng(seed)
    (seen, _), (twin_seen, _) = env.reset(seed=seed), twin.reset(seed=seed)
    for _ in range(10):
        assert env.observation_space.contains(seen)
        for key, value in seen.items():
            np.testing.assert_array_equal(value, twin_seen[key])
        action = stream.uniform(-0.2, 0.2, 4).astype(np.float32)
        seen, reward, terminated, truncated, info = env.step(action)
        twin_seen, twin_reward, *_, twin_info = twin.step(action)
        assert reward == twin_reward
        assert info == twin_info
        if terminated or truncated:
            break


def test_the_observation_turns_with_the_vehicle() -> None:
    ahead = Field(
        name="ahead",
        obstacles=Obstacles.discs([[50.0, 30.0], [30.0, 50.0]], [4.0, 2.0]),
        start=[30.0, 30.0],
        goal=[80.0, 30.0],
        start_derivative=[6.6, 0.0],
    )
    env = ObstacleField(observation="discs", nearest=4)
    seen, _ = env.reset(options={"field": ahead})
    speed = np.arcsinh(6.6 / 66.0 * np.sinh(4.0)) / 4.0
    np.testing.assert_allclose(
        seen["vehicle"], [-1 / 3, -1 / 3, 1.0, 0.0, speed, 1.0], rtol=1e-6, atol=1e-7
    )
    np.testing.assert_allclose(
        seen["goal"], [50 / (120 * np.sqrt(2)), 1.0, 0.0], rtol=1e-6, atol=1e-7
    )
    rows = seen["obstacles"].reshape(4, 4)
    np.testing.assert_allclose(
        rows[:2] * 30.0, [[20, 0, 4, 16], [0, 20, 2, 18]], rtol=1e-6, atol=1e-5
    )
    np.testing.assert_array_equal(seen["mask"], [1.0, 1.0, 0.0, 0.0])
    assert not rows[2:].any()


@pytest.mark.parametrize(
    ("end", "derivative", "outcome"),
    [
        ([8.0, 8.0], [5.0, 5.0], Outcome.COLLISION),
        ([1.0, 1.0], [1.0, 1.0], Outcome.TOO_SHORT),
        ([8.0, -8.0], [40.0, 40.0], Outcome.TOO_LONG),
        ([2.0, -9.9], [5.0, 12.0], Outcome.LEFT_BOUNDS),
        ([3.0, 3.0], [0.0, 0.0], Outcome.NOT_REGULAR),
    ],
)
def test_a_refused_segment_ends_the_flight_where_it_was(
    end: list[float], derivative: list[float], outcome: Outcome
) -> None:
    env = ObstacleField()
    env.reset(options={"field": Field(name="disc", obstacles=Obstacles.discs([[8.0, 8.0]], [3.0]))})
    before = env.state
    action = toward(env, np.array(end), np.array(derivative))
    _, reward, terminated, truncated, info = env.step(action)
    assert Outcome.from_code(info["outcome"]) is outcome
    assert terminated
    assert not truncated
    assert reward == -env.settings.failure
    assert env.state.segments == before.segments == 0
    np.testing.assert_array_equal(env.state.position, before.position)
    np.testing.assert_array_equal(env.state.derivative, before.derivative)
    assert info["segments"] == 0
    assert info["path_length"] == 0.0
    assert env.refused is not None
    assert len(env.control) == 0


def test_the_last_segment_truncates_and_counts_as_failure() -> None:
    env = ObstacleField()
    env.reset(options={"field": OPEN})
    step = 3.2 / np.sqrt(2.0)
    total = 0.0
    for k in range(1, 41):
        action = toward(env, np.array([step * k, step * k]), np.array([2.0, 2.0]))
        _, reward, terminated, truncated, info = env.step(action)
        total += reward
    assert truncated
    assert not terminated
    assert info["outcome"] == Outcome.OUT_OF_SEGMENTS.code
    assert not info["is_success"]
    assert info["segments"] == 40
    assert total == pytest.approx(128.0 / OPEN.distance - env.settings.failure)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros(3), r"action must have shape \(4,\), got \(3,\)"),
        (np.array([0.0, np.nan, 0.0, 0.0]), "action must be finite, got nan"),
        (np.array([0.0, 0.0, 1.5, 0.0]), r"an action lies in \[-1, 1\], got"),
    ],
)
def test_a_bad_action_is_refused_and_the_flight_goes_on(action: np.ndarray, message: str) -> None:
    env = ObstacleField()
    env.reset(options={"field": OPEN})
    with pytest.raises(ValueError, match=message):
        env.step(action)
    _, _, terminated, _, info = env.step(STILL)
    assert not terminated
    assert info["segments"] == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"suite": "jungle"}, "unknown suite 'jungle'; suites are standard, sparse"),
        ({"split": "exam"}, "unknown split 'exam'; splits are train, validation, test"),
        ({"nearest": 0}, "need nearest from 1 to 10000, got 0"),
        ({"render_mode": "ascii"}, "unknown render mode 'ascii'; modes are human, rgb_array"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ObstacleField(**arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wind": 3}, "unknown reset options"),
        ({"field": 7}, "must be a Field or the name of one, got int"),
        ({"field": "paper:5"}, "the paper has fields 1 to 4, not 5"),
    ],
)
def test_bad_reset_options_are_refused(options: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ObstacleField().reset(options=options)


def test_stepping_a_finished_flight_or_before_a_reset_is_an_error() -> None:
    env = ObstacleField()
    with pytest.raises(RuntimeError, match="reset"):
        env.step(STILL)
    env.reset(options={"field": OPEN})
    env.step(np.array([-1.0, 0.0, 0.0, 0.0], np.float32))
    with pytest.raises(RuntimeError, match="the flight is over"):
        env.step(STILL)


def test_the_picture_shows_the_flight() -> None:
    env = ObstacleField(render_mode="rgb_array")
    env.reset(options={"field": "paper:1"})
    before = env.render()
    env.step(STILL)
    after = env.render()
    assert before is not None
    assert after is not None
    assert before.shape == after.shape == (800, 800, 3)
    assert before.dtype == np.uint8
    assert (before != after).any()
    env.close()


def test_the_window_opens_without_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    env = ObstacleField(render_mode="human")
    env.reset(seed=1)
    env.step(STILL)
    assert env.render() is None
    env.close()


def test_the_docstring_names_every_observation_info_and_argument() -> None:
    text = ObstacleField.__doc__ or ""
    env = ObstacleField()
    seen, info = env.reset(seed=0)
    for name in (*seen, *info, "suite", "split", "nearest", "render_mode"):
        assert f"| {name} |" in text or f"`{name}`" in text
    assert ENVIRONMENT_ID in text
    assert ferguson_gym.__version__
