"""A region of the plane as an SVG picture, still or animated."""

from __future__ import annotations

import html
import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.svg.axes import PIXEL, UNITS, framed
from ferguson_gym.svg.colours import (
    GOAL,
    HORIZON,
    OBSTACLE,
    OBSTACLE_EDGE,
    REFUSED,
    SEGMENTS,
    START,
)
from ferguson_gym.svg.motion import Timeline, appearing, moving, trailing
from ferguson_gym.svg.outline import outline
from ferguson_gym.svg.path_data import chain_data, outline_data, pair, polyline_data, whole

_STAR = np.array(
    [
        (radius * np.sin(turn), -radius * np.cos(turn))
        for turn, radius in zip(np.pi * np.arange(10) / 5.0, [6.0, 2.4] * 5, strict=True)
    ]
)
"""Corners (10, 2) of the goal's star [px]."""


class Picture:
    """A region of the plane between two corners, with shapes and a caption; y points upwards.

    Notebooks show it; `save` writes it to a file. Shapes added later cover earlier ones;
    start, goal and vehicle cover all.
    """

    def __init__(self, low: Array, high: Array, caption: str = "") -> None:
        """Make an empty picture.

        Args:
            low: (2,) least coordinates [m].
            high: (2,) greatest coordinates [m].
            caption: Text above the region.
        """
        self._low, self._high = np.asarray(low, float), np.asarray(high, float)
        self._scale = UNITS / float((self._high - self._low).max())
        self._shapes: list[str] = []
        self._marks: list[str] = []
        self.caption = caption

    def __repr__(self) -> str:
        return f"<Picture: {self.caption}>"

    def add_obstacles(self, cores: Iterable[Array], radii: Array) -> None:
        """Add obstacles: convex cores (m, 2) in counter-clockwise order, and their radii (n,) [m].

        A core of a point is a disc.
        """
        shapes = "".join(self._obstacle(*one) for one in zip(cores, radii.tolist(), strict=True))
        look = f'fill="{OBSTACLE}" stroke="{OBSTACLE_EDGE}" stroke-width="{PIXEL // 2}"'
        self._shapes.append(f"<g {look}>{shapes}</g>")

    def _obstacle(self, core: Array, radius: float) -> str:
        if len(core) == 1:
            x, y = whole(self._placed(core[0]))
            return f'<circle cx="{x}" cy="{y}" r="{round(self._scale * radius)}"/>'
        arcs = self._placed(outline(core, radius).arcs)
        return f'<path d="{outline_data(arcs, self._scale * radius)}"/>'

    def add_ends(self, start: Array, goal: Array) -> None:
        """Add the marks of a start and a goal, both (2,) [m]."""
        x, y = whole(self._placed(start))
        self._marks.append(f'<circle cx="{x}" cy="{y}" r="{7 * PIXEL // 2}" fill="{START}"/>')
        x, y = whole(self._placed(goal))
        corners = " ".join(pair(corner) for corner in whole(PIXEL * _STAR + (x, y)))
        self._marks.append(f'<polygon points="{corners}" fill="{GOAL}"/>')

    def add_chain(self, control: Array) -> None:
        """Add segments (n, 4, 2) in alternating colours, and the knots between them."""
        placed = self._segments(control)
        for parity, colour in enumerate(SEGMENTS):
            data = "".join(chain_data(segment[None]) for segment in placed[parity::2])
            if data:
                self._line(data, f'stroke="{colour}" stroke-width="{2 * PIXEL}"')
        for segment in placed:
            self._shapes.append(_knot(segment[1]))

    def add_route(self, points: Array) -> None:
        """Add points (n, 2) of a route [m], joined by a thin line."""
        look = f'stroke="{HORIZON}" stroke-width="{PIXEL}" stroke-opacity="0.6"'
        self._line(polyline_data(self._placed(np.asarray(points))), look)

    def add_refused(self, control: Array, timeline: Timeline | None = None) -> None:
        """Add a segment (4, 2) that was not feasible, dotted; in an animation it appears last."""
        dots = f'stroke-dasharray="1 {3 * PIXEL}"'
        look = f'stroke="{REFUSED}" stroke-width="{2 * PIXEL}" {dots}'
        motion = "" if timeline is None else appearing(timeline, timeline.flown)
        self._line(chain_data(self._segments(control[None])), look, motion)

    def add_motion(self, control: Array, timeline: Timeline) -> None:
        """Add segments (n, 4, 2) as they are flown, and the vehicle that flies them.

        A viewer that does not animate shows the whole flight.
        """
        placed = self._segments(control)
        pale = f'stroke="{OBSTACLE_EDGE}" stroke-width="{PIXEL}" stroke-opacity="0.5"'
        self._line(chain_data(placed), pale)
        for k, segment in enumerate(placed):
            colour = SEGMENTS[k % len(SEGMENTS)]
            motion = trailing(timeline, k)
            dash = int(np.ceil(1.01 * self._scale * timeline.lengths[k])) + PIXEL
            look = f'stroke="{colour}" stroke-width="{2 * PIXEL}" stroke-dasharray="{dash}"'
            self._line(chain_data(segment[None]), look, motion.format(length=dash))
        for k, segment in enumerate(placed):
            self._shapes.append(_knot(segment[1], appearing(timeline, timeline.ends[k])))
        if len(placed):
            self._marks.append(moving(timeline, chain_data(placed)))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the picture to an `.svg` file.

        Raises:
            ValueError: another suffix.
            OSError: the file cannot be written.
        """
        if Path(path).suffix.lower() != ".svg":
            raise ValueError(f"pictures are saved as .svg, not {os.fspath(path)!r}")
        with atomic_write(path) as temporary:
            temporary.write_text(self._repr_svg_() + "\n", encoding="utf-8")

    def _repr_svg_(self) -> str:
        """The picture as text, which is what notebooks ask for."""
        return framed(
            self._low, self._high, html.escape(self.caption), "".join([*self._shapes, *self._marks])
        )

    def _placed(self, points: Array) -> Array:
        """Points (..., 2) [m] in units from the upper left corner, y downwards."""
        flipped = np.stack([points[..., 0] - self._low[0], self._high[1] - points[..., 1]], -1)
        placed: Array = self._scale * flipped
        return placed

    def _segments(self, control: Array) -> Array:
        """Segments (n, 4, 2) in units, y downwards."""
        slopes = self._scale * control[:, 2:] * (1.0, -1.0)
        return np.concatenate([self._placed(control[:, :2]), slopes], axis=1)

    def _line(self, data: str, look: str, motion: str = "") -> None:
        drawn = f'd="{data}" fill="none" stroke-linecap="round" {look}'
        self._shapes.append(f"<path {drawn}>{motion}</path>")


def _knot(point: Array, motion: str = "") -> str:
    """The mark between two segments at a point (2,) in units."""
    x, y = whole(point)
    look = f'fill="white" stroke="#333333" stroke-width="{round(0.7 * PIXEL)}"'
    return f'<circle cx="{x}" cy="{y}" r="{2 * PIXEL}" {look}>{motion}</circle>'
