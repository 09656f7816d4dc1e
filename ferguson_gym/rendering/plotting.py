"""Plots of single fields and paths on matplotlib axes, which `Field.plot` and `Path.plot` call."""

from __future__ import annotations

from matplotlib.axes import Axes

from ferguson_gym.curves.path import Path
from ferguson_gym.rendering.drawing import draw_field, draw_path
from ferguson_gym.world.field import Field


def plot_field(field: Field, axes: Axes | None = None) -> Axes:
    """Draw obstacles, start, goal and bounds; without axes on pyplot's current ones.

    Raises:
        ValueError: a field that is not planar.
    """
    axes = _planar_axes(axes, "field", len(field.start))
    draw_field(axes, field)
    return axes


def plot_path(path: Path, axes: Axes | None = None) -> Axes:
    """Draw segments in alternating colours; without axes on pyplot's current ones.

    Raises:
        ValueError: a path that is not planar.
    """
    axes = _planar_axes(axes, "path", path.control.shape[-1])
    draw_path(axes, path.control)
    axes.set_aspect("equal")
    axes.autoscale_view()  # limits that were set, as by `plot_field`, stay
    return axes


def _planar_axes(axes: Axes | None, what: str, dimension: int) -> Axes:
    """The axes to draw on, after a check that a thing is planar."""
    if dimension != 2:
        raise ValueError(f"only a planar {what} is plotted, this one has {dimension} dimensions")
    if axes is not None:
        return axes
    import matplotlib.pyplot as plt

    return plt.gca()
