"""Videos hold the frames along segments, at the rate that the environment declares."""

import importlib.machinery
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.rendering import RecordVideo
from ferguson_gym.rendering.viewer import HOLD

AHEAD, BACK = np.zeros(4, np.float32), np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
CLIP = "moviepy.video.io.ImageSequenceClip"
Clips = dict[str, tuple[int, int]]


@pytest.fixture
def clips(monkeypatch: pytest.MonkeyPatch) -> Clips:
    """The number of frames and the rate of each video written, by a stand-in for moviepy."""
    written: Clips = {}

    class ImageSequenceClip:
        def __init__(self, frames: list[Any], fps: int) -> None:
            self.clip = len(frames), fps

        def write_videofile(self, path: str, logger: object) -> None:
            written[Path(path).name] = self.clip

    names = CLIP.split(".")
    for k in range(len(names)):
        module = ModuleType(".".join(names[: k + 1]))
        module.__spec__ = importlib.machinery.ModuleSpec(module.__name__, None)
        module.__path__ = []
        monkeypatch.setitem(sys.modules, module.__name__, module)
    sys.modules[CLIP].ImageSequenceClip = ImageSequenceClip  # type: ignore[attr-defined]
    return written


def record(recorder: type, render_mode: str, folder: Path, **arguments: Any) -> None:
    env = gym.make(ENVIRONMENT_ID, render_mode=render_mode, obstacles=3)
    env = recorder(env, str(folder), episode_trigger=lambda _: True, **arguments)
    for _ in range(2):
        env.reset(seed=5)
        for action in (AHEAD, AHEAD, BACK):
            env.step(action)
    env.close()


def test_lists_of_frames_are_recorded_whole(clips: Clips, tmp_path: Path) -> None:
    record(RecordVideo, "rgb_array_list", tmp_path / "videos")
    smooth = 1 + 6 + 6 + HOLD, 20  # the start, two segments of 9 m, the end
    assert clips == {"rl-video-episode-0.mp4": smooth, "rl-video-episode-1.mp4": smooth}


@pytest.mark.parametrize("recorder", [RecordVideo, gym.wrappers.RecordVideo])
def test_single_frames_are_recorded_as_gymnasium_does(
    recorder: type, clips: Clips, tmp_path: Path
) -> None:
    record(recorder, "rgb_array", tmp_path / "videos", name_prefix="one")
    assert clips == {"one-episode-0.mp4": (4, 4), "one-episode-1.mp4": (4, 4)}


def test_gymnasiums_save_video_takes_the_list(clips: Clips, tmp_path: Path) -> None:
    sys.modules.pop("gymnasium.utils.save_video", None)  # imports moviepy when it is imported
    try:
        from gymnasium.utils.save_video import save_video

        env = gym.make(ENVIRONMENT_ID, render_mode="rgb_array_list", obstacles=3)
        env.reset(seed=5)
        env.step(AHEAD)
        save_video(env.render(), str(tmp_path), fps=env.metadata["render_fps"])
    finally:
        sys.modules.pop("gymnasium.utils.save_video", None)
    assert clips == {"rl-video-episode-0.mp4": (7, 20)}


def test_a_missing_moviepy_is_named_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    env = gym.make(ENVIRONMENT_ID, render_mode="rgb_array_list")
    with pytest.raises(gym.error.DependencyNotInstalled, match=r"videos need moviepy: .*\[video\]"):
        RecordVideo(env, str(tmp_path))


def test_a_video_is_written(tmp_path: Path) -> None:
    pytest.importorskip("moviepy")
    import imageio_ffmpeg

    record(RecordVideo, "rgb_array_list", tmp_path / "videos")
    number, seconds = imageio_ffmpeg.count_frames_and_secs(
        tmp_path / "videos" / "rl-video-episode-1.mp4"
    )
    assert number == 13 + HOLD
    assert seconds == pytest.approx(number / 20, abs=0.06)
