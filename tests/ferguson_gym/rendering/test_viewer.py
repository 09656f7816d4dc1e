"""Pictures of running flights: copies draw on, lists of frames move smoothly, notebooks follow."""

import copy
import itertools
import pickle
import sys
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import matplotlib as mpl
import numpy as np
import pytest

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.curves import length
from ferguson_gym.environment import ObstacleField
from ferguson_gym.rendering.motion import FPS, STRIDE, parts
from ferguson_gym.rendering.viewer import HOLD, Viewer
from ferguson_gym.svg import Picture
from ferguson_gym.svg.colours import SEGMENTS
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world import Outcome

AHEAD = np.zeros(4, np.float32)
BACK = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
"""An action that is refused."""
COPIES = {
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


def make(render_mode: str) -> ObstacleField:
    env = ObstacleField(render_mode=render_mode, obstacles=3)
    env.reset(seed=5)
    return env


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
def test_the_original_and_its_copy_both_render(duplicate: Callable[[Any], Any]) -> None:
    env = make("rgb_array")
    env.render()
    twin = duplicate(env)
    for one in (env, twin):
        one.step(AHEAD)
    before = env.render()
    assert (twin.render() == before).all()
    twin.step(AHEAD)
    assert (twin.render() != before).any()
    twin.close()
    assert (env.render() == before).all()


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
def test_vector_environments_and_their_copies_both_render(
    duplicate: Callable[[Any], Any],
) -> None:
    envs = VectorObstacleField(2, render_mode="rgb_array", obstacles=3)
    envs.reset(seed=5)
    before = envs.render()
    twins = duplicate(envs)
    for one in (envs, twins):
        for image, same in zip(one.render(), before, strict=True):
            assert (image == same).all()


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
def test_a_copy_opens_a_window_of_its_own(
    duplicate: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("agg")
    env = make("human")
    opened = plt.get_fignums()
    twin = duplicate(env)
    twin.step(AHEAD)
    assert len(plt.get_fignums()) == len(opened) + 1
    twin.close()
    assert plt.get_fignums() == opened
    env.step(AHEAD)
    env.close()
    assert plt.get_fignums() == []


@pytest.mark.parametrize("duplicate", COPIES.values(), ids=COPIES)
def test_a_copy_lists_the_frames_that_the_original_would(duplicate: Callable[[Any], Any]) -> None:
    env = make("rgb_array_list")
    env.step(AHEAD)
    env.render()
    twin = duplicate(env)
    assert twin.render() == []
    listed = []
    for one in (env, twin):
        one.step(AHEAD)
        listed.append(np.stack(one.render()))
    assert (listed[0] == listed[1]).all()


def test_frames_follow_each_segment_and_end_on_the_picture_of_the_flight() -> None:
    env, still = make("rgb_array_list"), make("rgb_array")
    assert env.metadata["render_fps"] == FPS == 20
    assert still.metadata["render_fps"] == ObstacleField.metadata["render_fps"] == 4
    assert len(env.render()) == 1  # the start
    assert env.render() == []
    for action, number in ((AHEAD, 6), (AHEAD, 6), (BACK, HOLD)):
        env.step(action)
        still.step(action)
        frames = env.render()
        assert len(frames) == number
        assert {frame.shape for frame in frames} == {(800, 800, 3)}
        if action is AHEAD:
            for one, other in itertools.pairwise(frames):
                assert (one != other).any()
    assert env.refused is not None
    assert (frames[-1] == still.render()).all()
    assert env.render() == []
    env.reset(seed=5)
    assert len(env.render()) == 1


def test_frames_not_asked_for_are_listed_later_and_cleared_by_a_reset() -> None:
    env = make("rgb_array_list")
    for _ in range(2):
        env.step(AHEAD)
    late = env.render()
    env.reset(seed=5)
    soon = env.render()
    for _ in range(2):
        env.step(AHEAD)
        soon += env.render()
    assert len(late) == len(soon) == 13
    assert (np.stack(late) == np.stack(soon)).all()
    env.step(AHEAD)
    env.reset(seed=5)
    assert len(env.render()) == 1


def test_a_frame_on_a_kept_background_is_the_frame_drawn_from_nothing() -> None:
    kept = Viewer("rgb_array")
    for seed in (5, 6):
        env = ObstacleField(obstacles=20)
        env.reset(seed=seed)
        for _ in range(3):
            given = env.field, env.control, env.refused, Outcome.FLYING
            assert (kept.draw(*given) == Viewer("rgb_array").draw(*given)).all()
            env.step(AHEAD)


def test_strides_along_a_segment_are_equal() -> None:
    bend = np.array([[0.0, 0.0], [8.0, 6.0], [20.0, 0.0], [0.0, 3.0]])
    flown = list(parts(bend))
    assert (flown[-1] == bend).all()
    steps = np.diff([0.0, *(float(length(part)) for part in flown)])
    assert steps.mean() == pytest.approx(STRIDE, rel=0.1)
    assert np.ptp(steps) < 0.01 * STRIDE


@pytest.mark.parametrize("render_mode", ["rgb_array_list", "rgb_array"])
def test_gymnasium_makes_and_checks_every_mode(render_mode: str) -> None:
    env = gym.make(ENVIRONMENT_ID, render_mode=render_mode, obstacles=3)
    assert env.render_mode == render_mode
    assert not isinstance(env, gym.wrappers.RenderCollection)
    env.reset(seed=0)
    assert isinstance(env.render(), list) == (render_mode == "rgb_array_list")
    again = gym.make(env.spec)
    assert again.render_mode == render_mode
    assert again.metadata["render_fps"] == env.metadata["render_fps"]


class FakeNotebook:
    """What is used of IPython in a notebook."""

    def __init__(self) -> None:
        self.cell = 1
        self.shown: list[list[Picture]] = []
        self.display = SimpleNamespace(display=self._display)

    def get_ipython(self) -> Any:
        return SimpleNamespace(execution_count=self.cell)

    def _display(self, picture: Picture, *, display_id: bool) -> Any:
        assert display_id
        output = [picture]
        self.shown.append(output)
        return SimpleNamespace(update=output.append)


def test_a_notebook_has_one_picture_of_a_flight_that_is_updated_in_place(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    notebook = FakeNotebook()
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    monkeypatch.setattr(mpl, "get_backend", lambda: "inline")
    env = make("human")  # shown by the reset
    env.step(AHEAD)
    assert [len(output) for output in notebook.shown] == [2]
    env.reset(seed=6)  # in the same cell
    assert [len(output) for output in notebook.shown] == [3]
    notebook.cell = 2
    env.step(AHEAD)  # the same flight, in the next cell
    assert [len(output) for output in notebook.shown] == [4]
    env.reset(seed=7)
    assert [len(output) for output in notebook.shown] == [4, 1]
    assert env.render() is None
    env.close()
    last = notebook.shown[0][-1]
    assert last.caption == "standard/train:6, 3 obstacles: 1 segments, 9.0 m, still on its way"
    assert last._repr_svg_().count(SEGMENTS[0]) == 1  # one segment, the others' colour is missing
    assert SEGMENTS[1] not in last._repr_svg_()
