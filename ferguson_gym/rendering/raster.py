"""Pictures of a running flight as pixels; what does not change is drawn once for a field."""

from __future__ import annotations

from typing import Any, cast

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ferguson_gym.curves.arc_length import length
from ferguson_gym.rendering.drawing import draw_field, draw_path, draw_refused, draw_vehicle, style
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome

SIZE = 800
"""Pixels along each side of an image."""
INCHES = 8.0
"""Width and height of the figure [in]."""
PLACE = (0.06, 0.05, 0.9, 0.9)
"""Left, bottom, width and height of the axes, as parts of the figure."""


def caption(field: Field, control: Array, outcome: Outcome, part: Array | None = None) -> str:
    """Title of a picture: name of the field, segments flown, distance with any part, outcome."""
    metres = float(length(control).sum()) + (0.0 if part is None else float(length(part)))
    return f"{field.name}: {len(control)} segments, {metres:.1f} m, {outcome.sentence}"


class Raster:
    """Draws flights off screen. Obstacles and axes are drawn once for consecutive frames."""

    def __init__(self) -> None:
        self._figure = Figure(figsize=(INCHES, INCHES), dpi=SIZE / INCHES)
        self._canvas = cast(Any, FigureCanvasAgg(self._figure))
        self._field: Field | None = None

    def frame(
        self,
        field: Field,
        control: Array,
        refused: Array | None,
        outcome: Outcome,
        part: Array | None = None,
    ) -> NDArray[np.uint8]:
        """Draw a frame (SIZE, SIZE, 3).

        Args:
            field: What is flown through.
            control: Segments (n, 4, 2) flown completely.
            refused: The segment (4, 2) that ended the flight without being flown, if any.
            outcome: How the flight ended, or that it has not.
            part: The first part (4, 2) of the next segment; the vehicle is drawn at its end.
        """
        with mpl.rc_context(style()):
            if field is not self._field:
                self._draw_background(field)
            axes = self._axes
            before = set(axes.get_children())
            draw_path(axes, control)
            if part is not None:
                draw_path(axes, part[None], first=len(control), knots=False)
                draw_vehicle(axes, part[1], part[3])
            if refused is not None:
                draw_refused(axes, refused)
            drawn = [artist for artist in axes.get_children() if artist not in before]
            axes.set_title(caption(field, control, outcome, part), parse_math=False)
            self._canvas.restore_region(self._background)
            layers = sorted([*drawn, *self._in_front], key=Artist.get_zorder)
            for artist in layers:
                axes.draw_artist(artist)
            for artist in drawn:
                artist.remove()
        return np.array(np.asarray(self._canvas.buffer_rgba())[..., :3], dtype=np.uint8)

    def _draw_background(self, field: Field) -> None:
        self._figure.clear()
        self._axes = axes = self._figure.add_axes(PLACE)
        draw_field(axes, field)
        # start and goal lie above the path, and the title changes
        self._in_front: list[Artist] = [*axes.get_lines(), axes.title]
        for artist in self._in_front:
            artist.set_animated(True)  # left out of the background
        self._canvas.draw()
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)
        self._field = field
