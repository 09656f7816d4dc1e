"""The picture of a running flight in each render mode: pixels, smooth motion, or a window."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from ferguson_gym.rendering.drawing import draw_field, draw_path, draw_refused, style
from ferguson_gym.rendering.motion import parts
from ferguson_gym.rendering.notebook import NotebookOutput, is_inline
from ferguson_gym.rendering.raster import INCHES, PLACE, Raster, caption
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome

Image = NDArray[np.uint8]

HOLD = 20
"""Number of times that the last frame of a flight is listed: a second."""


class Viewer:
    """Draws one flight at a time in a render mode of the environment.

    Figures and windows are kept between frames. A copy has none of them, and makes its own when it
    draws: the original and its copy can both go on.
    """

    def __init__(self, mode: str) -> None:
        """Draw in mode `rgb_array`, `rgb_array_list` or `human`."""
        self._mode = mode
        self._listed = 0
        """Pictures of this flight listed so far: of its start, its segments and its end."""
        self._canvas: Any = None

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_canvas": None}

    def begin(self) -> None:
        """Begin another flight, whose frames are listed from its start."""
        self._listed = 0
        if isinstance(self._canvas, NotebookOutput):
            self._canvas.begin()

    def draw(
        self, field: Field, control: Array, refused: Array | None, outcome: Outcome
    ) -> Image | list[Image] | None:
        """Draw a flight so far.

        Returns:
            A frame (SIZE, SIZE, 3) in mode `rgb_array`; in mode `rgb_array_list` the frames since
            the last call; nothing in mode `human`, which shows it.
        """
        if self._canvas is None:
            self._canvas = self._new_canvas()
        if self._mode == "rgb_array_list":
            return self._list(field, control, refused, outcome)
        image: Image | None = self._canvas.frame(field, control, refused, outcome)
        return image

    def _new_canvas(self) -> Raster | NotebookOutput | Window:
        if self._mode != "human":
            return Raster()
        return NotebookOutput() if is_inline(mpl.get_backend()) else Window()

    def _list(
        self, field: Field, control: Array, refused: Array | None, outcome: Outcome
    ) -> list[Image]:
        raster, flying = self._canvas, Outcome.FLYING
        frames: list[Image] = []
        if self._listed == 0:
            frames.append(raster.frame(field, control[:0], None, flying, _standing(field)))
            self._listed = 1
        for k in range(self._listed - 1, len(control)):
            flown = parts(control[k])
            frames += [raster.frame(field, control[:k], None, flying, part) for part in flown]
        self._listed = max(self._listed, len(control) + 1)
        if outcome is not flying and self._listed < len(control) + 2:
            frames += [raster.frame(field, control, refused, outcome)] * HOLD
            self._listed = len(control) + 2
        return frames

    def close(self) -> None:
        """Close the window, if there is one."""
        if isinstance(self._canvas, Window):
            self._canvas.close()
        self._canvas = None


def _standing(field: Field) -> Array:
    """A segment (4, 2) of no length that starts and ends at the start, in its direction."""
    return np.stack([field.start, field.start, field.departure, field.departure])


class Window:
    """A window of matplotlib's that shows a flight."""

    def __init__(self) -> None:
        import matplotlib.pyplot as plt

        self._figure: Any = plt.figure(figsize=(INCHES, INCHES))

    def frame(self, field: Field, control: Array, refused: Array | None, outcome: Outcome) -> None:
        """Draw a flight and let the window handle its events."""
        import matplotlib.pyplot as plt

        with mpl.rc_context(style()):
            self._figure.clear()
            axes = self._figure.add_axes(PLACE)
            draw_field(axes, field)
            draw_path(axes, control)
            if refused is not None:
                draw_refused(axes, refused)
            axes.set_title(caption(field, control, outcome), parse_math=False)
            self._figure.canvas.draw()
        self._figure.canvas.flush_events()
        if mpl.get_backend().lower() != "agg":  # which has no window to wait for
            plt.pause(0.001)

    def close(self) -> None:
        """Close the window."""
        import matplotlib.pyplot as plt

        plt.close(self._figure)
