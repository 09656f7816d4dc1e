"""Drawing fields, paths and planned horizons on matplotlib axes, in one style."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.markers import MarkerStyle
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.transforms import Affine2D

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.svg.colours import GOAL as GOAL
from ferguson_gym.svg.colours import HORIZON as HORIZON
from ferguson_gym.svg.colours import OBSTACLE as OBSTACLE
from ferguson_gym.svg.colours import OBSTACLE_EDGE as OBSTACLE_EDGE
from ferguson_gym.svg.colours import REFUSED as REFUSED
from ferguson_gym.svg.colours import SEEN as SEEN
from ferguson_gym.svg.colours import SEGMENTS as SEGMENTS
from ferguson_gym.svg.colours import START as START
from ferguson_gym.svg.outline import outline
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

_T = np.linspace(0.0, 1.0, 60)


def draw_field(axes: Axes, field: Field) -> None:
    """Obstacles, start, goal and bounds (the frame of the axes)."""
    low, high = field.bounds
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.tick_params(labelsize=7, length=2.5, color=OBSTACLE_EDGE)
    for spine in axes.spines.values():
        spine.set_color(OBSTACLE_EDGE)
    draw_obstacles(axes, field.obstacles)
    axes.plot(*field.start, "o", color=START, ms=5, zorder=6)
    axes.plot(*field.goal, "*", color=GOAL, ms=9, zorder=6)


def draw_obstacles(axes: Axes, obstacles: Obstacles, colour: str = OBSTACLE) -> None:
    """Obstacles in the plane."""
    shapes = [
        _shape(obstacles.core(k), radius) for k, radius in enumerate(obstacles.radii.tolist())
    ]
    patches = PatchCollection(shapes, facecolor=colour, edgecolor=OBSTACLE_EDGE, lw=0.5)
    axes.add_collection(patches)


def _shape(core: Array, radius: float) -> Patch:
    """A convex core (m, 2), grown by a radius [m]."""
    if len(core) == 1:
        return Circle((float(core[0, 0]), float(core[0, 1])), radius)
    return Polygon(outline(core, radius).points)


def draw_path(axes: Axes, control: Array, *, first: int = 0, knots: bool = True) -> None:
    """Segments (n, 4, 2) in alternating colours, and the knots between them.

    Args:
        axes: Where they are drawn.
        control: Segments, of which the first has the number `first` in its path.
        first: Decides the colour.
        knots: Whether the ends of segments are marked.
    """
    if len(control) == 0:
        return
    colours = [SEGMENTS[k % 2] for k in range(first, first + len(control))]
    lines = LineCollection(
        list(evaluate(control, _T)), colors=colours, lw=1.8, zorder=4, capstyle="round"
    )
    axes.add_collection(lines)
    if knots:
        x, y = control[:, 1].T
        axes.plot(x, y, "o", mfc="white", mec="#333333", mew=0.7, ms=3, zorder=5)


def draw_horizons(axes: Axes, horizons: Sequence[Array]) -> None:
    """Planned windows, each (n, 4, 2): thin dashed lines under the path, a dot at the end."""
    for control in horizons:
        for points in evaluate(control, _T):
            axes.plot(points[:, 0], points[:, 1], "--", color=HORIZON, lw=0.9, zorder=3, alpha=0.8)
        axes.plot(*control[-1, 1], ".", color=HORIZON, ms=4, zorder=3)


def draw_refused(axes: Axes, control: Array) -> None:
    """A segment (4, 2) that was not feasible and therefore not flown."""
    points = evaluate(control, _T)
    axes.plot(points[:, 0], points[:, 1], ":", color=REFUSED, lw=1.6, zorder=4)


def draw_vehicle(axes: Axes, position: Array, heading: Array) -> None:
    """The vehicle at a position (2,), as a dart that points along its derivative (2,)."""
    dart = [(-0.5, 0.0), (-0.9, 0.75), (1.1, 0.0), (-0.9, -0.75), (-0.5, 0.0)]
    turn = Affine2D().rotate(float(np.arctan2(heading[1], heading[0])))
    marker = MarkerStyle(np.array(dart) @ turn.get_matrix()[:2, :2].T)
    axes.plot(*position, marker=marker, ms=17, mfc="black", mec="white", mew=0.8, zorder=7)


def style() -> dict[Any, Any]:
    """Matplotlib settings shared by all figures, for `matplotlib.rc_context`."""
    return {
        "text.color": "black",
        "axes.facecolor": "white",
        "font.size": 8,
        "axes.titlesize": 9,
        "axes.linewidth": 0.8,
        "figure.facecolor": "white",
        "savefig.dpi": 200,
    }
