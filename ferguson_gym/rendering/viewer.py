"""The picture of a running flight, off screen or in a window."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ferguson_gym.curves.arc_length import length
from ferguson_gym.rendering.drawing import draw_field, draw_path, draw_refused, style
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome

SIZE = 800
"""Pixels along each side of an image."""


class Viewer:
    """Draws one flight at a time; keeps its figure between frames."""

    def __init__(self, mode: str) -> None:
        self._mode = mode
        self._figure: Any
        if mode == "human":
            import matplotlib.pyplot as plt

            self._figure = plt.figure(figsize=(8, 8))
        else:
            self._figure = Figure(figsize=(8, 8), dpi=SIZE / 8)
            FigureCanvasAgg(self._figure)

    def draw(
        self, field: Field, control: Array, refused: Array | None, outcome: Outcome
    ) -> NDArray[np.uint8] | None:
        """Draw a frame; returns (SIZE, SIZE, 3) unless it is shown in a window."""
        with mpl.rc_context(style()):
            self._figure.clear()
            axes = self._figure.add_axes((0.06, 0.05, 0.9, 0.9))
            draw_field(axes, field)
            draw_path(axes, control)
            if refused is not None:
                draw_refused(axes, refused)
            flown = float(length(control).sum())
            axes.set_title(
                f"{field.name}: {len(control)} segments, {flown:.1f} m, {outcome.sentence}",
                parse_math=False,
            )
            self._figure.canvas.draw()
        if self._mode == "human":
            import matplotlib.pyplot as plt

            self._figure.canvas.flush_events()
            if mpl.get_backend().lower() != "agg":  # which has no window to wait for
                plt.pause(0.001)
            return None
        image = np.asarray(self._figure.canvas.buffer_rgba())[..., :3]
        return np.array(image, dtype=np.uint8)

    def close(self) -> None:
        """Close the window."""
        if self._mode == "human":
            import matplotlib.pyplot as plt

            plt.close(self._figure)
