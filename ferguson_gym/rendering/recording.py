"""Videos of flights in smooth motion, by Gymnasium's recorder."""

from __future__ import annotations

import importlib.util
from typing import Any

import gymnasium as gym

from ferguson_gym.runtime.optional_dependencies import installing


class RecordVideo(gym.wrappers.RecordVideo[Any, Any]):
    """Gymnasium's `RecordVideo`, which writes all frames of an environment that lists them.

    In render mode `rgb_array_list` the environment draws frames along each segment, and this
    wrapper records all of them. Gymnasium's own keeps only the last frame of each list, so that
    flights jump from segment to segment. Arguments, files and other render modes are the same.

    Raises:
        DependencyNotInstalled: moviepy is missing, which the extra `video` installs.
        ValueError: a render mode without images.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        if importlib.util.find_spec("moviepy") is None:
            raise gym.error.DependencyNotInstalled(f"videos need moviepy: {installing('video')}")
        super().__init__(*args, **kwargs)

    def _capture_frame(self) -> None:
        frames: Any = self.env.render()
        self.recorded_frames += frames if isinstance(frames, list) else [frames]
