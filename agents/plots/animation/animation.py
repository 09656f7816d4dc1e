"""Draws the frames of an animation and writes them as a GIF, for `ferguson animate`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, cast

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from rich.progress import Progress

from agents.flights import Flight
from agents.plots.animation.frames import Frame, frames_of
from agents.plots.animation.gif import Palette, Pixels, write_gif
from ferguson_gym.curves import evaluate
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import DistanceToGoal
from ferguson_gym.world import Field

SIZE = 720
"""Pixels along the longer side of the field; narrow fields get room for the caption below."""
_DPI = 112
_FRAME, _CAPTION = 8, 28
"""Pixels of the border around the field, and of the caption below."""
_TITLE = 36
"""Upper limit of the title's characters, which leaves room for the caption."""
_LEVELS = 16
"""Number of bands of equal distance to the goal."""
_BANDS = "#cfe3d6", "#fafcfb"
"""Colours of the nearest and the farthest band."""
_SAMPLES = 6
"""Number of frames from which the palette is made."""
_CELLS = 240
"""Grid points along each side of the field, on which the distance to the goal is drawn."""
_T = np.linspace(0.0, 1.0, 60)


class Painter:
    """Draws the frames of one field on a background that is drawn once.

    The background shows the obstacles, bands of equal distance to the goal and the shortest path. A
    dotted line continues a plan along the shortest path to the goal.
    """

    def __init__(self, field: Field, title: str, *, surveyed: bool = True) -> None:
        """Draw the background, with bands if all obstacles are known from the start (surveyed)."""
        title = title if len(title) <= _TITLE else title[: _TITLE - 1] + "\N{HORIZONTAL ELLIPSIS}"
        self._field = field
        low, high = field.bounds
        extent = (high - low) / (high - low).max()
        width, height = np.maximum(SIZE * extent, (0.9 * SIZE, 0.1 * SIZE)).round()
        wide, tall = width + 2 * _FRAME, height + 2 * _FRAME + _CAPTION
        self._figure = Figure(figsize=(wide / _DPI, tall / _DPI), dpi=_DPI)
        self._canvas = cast(Any, FigureCanvasAgg(self._figure))
        place = (_FRAME / wide, (_FRAME + _CAPTION) / tall, width / wide, height / tall)
        self._togo = DistanceToGoal(field)
        path = self._togo.path(field.start)
        self._shortest = np.empty((0, 2)) if path is None else path.points(0.5)
        with mpl.rc_context(drawing.style()):
            axes = self._figure.add_axes(place)
            if surveyed:
                _draw_levels(axes, field, self._togo)
            drawing.draw_field(axes, field)
            axes.set(xticks=[], yticks=[])
            _write(self._figure, axes, title, "left")
            self._canvas.draw()
            self._background = self._canvas.copy_from_bbox(self._figure.bbox)
            self._overlay = self._figure.add_axes(place)
            limits = {"xlim": field.bounds[:, 0], "ylim": field.bounds[:, 1]}
            self._overlay.set(**limits, aspect="equal")
            self._overlay.set_axis_off()

    def paint(self, frame: Frame) -> Pixels:
        """The pixels (height, width, 3) of a frame."""
        axes = self._overlay
        with mpl.rc_context(drawing.style()):
            # clearing the axes would make new ones of x and y, a quarter of the time
            for artist in (*axes.lines, *axes.collections, *axes.patches, *axes.texts):
                artist.remove()
            self._draw(axes, frame)
            self._canvas.restore_region(self._background)
            axes.draw(self._canvas.get_renderer())
        return np.array(np.asarray(self._canvas.buffer_rgba())[..., :3], dtype=np.uint8)

    def _draw(self, axes: Axes, frame: Frame) -> None:
        togo = self._togo
        if frame.known is not None:
            togo = DistanceToGoal(frame.known)
            drawing.draw_obstacles(axes, frame.known.obstacles, drawing.SEEN)
        elif frame.origin is not None:
            _draw_reach(axes, self._field, frame.origin, frame.reach)
        axes.plot(*self._shortest.T, color="black", lw=0.8, alpha=0.45, zorder=2)
        if frame.route is not None:
            axes.plot(*frame.route.T, color=drawing.HORIZON, lw=0.8, alpha=0.6, zorder=2)
        _draw_chains(axes, frame.candidates, lw=1.0, alpha=0.5, zorder=3)
        for guess in frame.candidates:
            axes.plot(*guess[:, 1].T, ".", color=drawing.HORIZON, alpha=0.6, ms=4, zorder=3)
        if frame.start is not None:
            _draw_chains(axes, [frame.start], lw=1.0, alpha=0.9, ls=(0, (2, 2)), zorder=3)
        if len(frame.plan):
            _draw_chains(axes, [frame.plan], lw=2.0, zorder=3)
            knots = frame.plan[:, 1]
            axes.plot(*knots.T, "o", mfc="white", mec=drawing.HORIZON, mew=0.9, ms=3.2, zorder=4)
            ahead = togo.path(knots[-1])
            if ahead is not None:
                axes.plot(*ahead.points(0.5).T, ":", color=drawing.HORIZON, lw=1.2, zorder=3)
        drawing.draw_path(axes, frame.flown)
        colour = drawing.SEGMENTS[len(frame.flown) % 2]
        axes.plot(*frame.trail.T, color=colour, lw=1.8, zorder=4, solid_capstyle="round")
        if frame.refused is not None:
            drawing.draw_refused(axes, frame.refused)
        if not np.array_equal(frame.position, self._field.goal):
            drawing.draw_vehicle(axes, frame.position, frame.heading)
        axes.plot(*self._field.start, "o", color=drawing.START, ms=5, zorder=6)
        axes.plot(*self._field.goal, "*", color=drawing.GOAL, ms=9, zorder=6)
        _write(self._figure, axes, frame.caption, "right")


def _draw_levels(axes: Axes, field: Field, togo: DistanceToGoal) -> None:
    """Draw bands of equal distance to the goal, lighter with distance."""
    x, y = (np.linspace(low, high, _CELLS) for low, high in field.bounds.T)
    points = np.stack(np.meshgrid(x, y), axis=-1)
    distance = togo(points.reshape(-1, 2))[0].reshape(_CELLS, _CELLS)
    masked = np.ma.masked_invalid(distance)
    if masked.count() == 0:
        return
    levels = np.linspace(0.0, float(masked.max()), _LEVELS + 1)
    bands = LinearSegmentedColormap.from_list("bands", _BANDS)
    axes.contourf(x, y, masked, levels, cmap=bands, zorder=0)
    axes.contour(x, y, masked, levels, colors="white", linewidths=0.8, zorder=0)


def _draw_reach(axes: Axes, field: Field, origin: Array, reach: float) -> None:
    """Draw the range of a plan and the obstacles in it."""
    look: dict[str, Any] = {"ec": drawing.HORIZON, "lw": 0.8, "ls": (0, (1, 3)), "zorder": 1}
    axes.add_patch(Circle(tuple(origin), reach, fill=False, **look))
    drawing.draw_obstacles(axes, field.obstacles.near(origin, reach), drawing.SEEN)


def _draw_chains(axes: Axes, chains: Sequence[Array], **look: Any) -> None:
    lines = [evaluate(chain, _T).reshape(-1, 2) for chain in chains]
    axes.add_collection(LineCollection(lines, colors=drawing.HORIZON, **look), autolim=False)


def _write(figure: Figure, axes: Axes, text: str, side: Literal["left", "right"]) -> None:
    """Write a text below the field."""
    wide, tall = figure.get_size_inches() * _DPI
    x = _FRAME / wide if side == "left" else 1.0 - _FRAME / wide
    place: Any = {"transform": figure.transFigure, "ha": side, "va": "center_baseline"}
    axes.text(x, (0.5 * _CAPTION + 2) / tall, text, parse_math=False, **place)


def animate(flight: Flight, path: Path, progress: Progress) -> int:
    """Write a flight as a GIF; returns the number of frames."""
    frames = list(frames_of(flight))
    surveyed = all(frame.known is None for frame in frames)
    title = f"{flight.policy} on {flight.field.name}"
    painter = Painter(flight.field, title, surveyed=surveyed)
    some = np.linspace(0, len(frames) - 1, _SAMPLES).astype(int)
    palette = Palette([painter.paint(frames[k]) for k in some])
    drawn = map(painter.paint, progress.track(frames, description="frames"))
    write_gif(path, drawn, [frame.seconds for frame in frames], palette)
    return len(frames)
