"""A figure of the routes and paths of all planners through one field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from agents.benchmarks.planners.runs import Run
from agents.benchmarks.planners.styles import Style
from agents.plots.figure import figure_file
from ferguson_gym.curves import Path
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array

_ALIKE = 1.5
"""Distance [m], two line widths, within which paths are drawn as one line with stripes."""
_DASH = 6.0
"""Length of a stripe [pt]."""


def most_different_runs(runs: Sequence[Run]) -> list[Run]:
    """The runs of the first field and seed with the largest number of different paths."""
    together: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        together.setdefault((run.field.name, run.seed), []).append(run)
    return max(together.values(), key=lambda some: len(_alike(_paths(some))))


def _paths(runs: Sequence[Run]) -> dict[str, Array]:
    return {run.planner: Path(run.control).points() for run in runs if run.success}


def draw_paths(runs: Sequence[Run], styles: Mapping[str, Style], path: FilePath) -> None:
    """Draw one field twice: with the routes found, and with the paths fitted to them."""
    field = runs[0].field
    routes = {run.planner: run.route.points for run in runs if run.route is not None}
    flown = _paths(runs)
    with figure_file(path, 7.4, 4.15 + 0.16 * -(-len(runs) // 3)) as figure:
        panels = ((routes, "routes before the fit"), (flown, "certified paths"))
        for axes, (curves, title) in zip(figure.subplots(1, 2), panels, strict=True):
            drawing.draw_field(axes, field)
            axes.set_title(f"{field.name}: {title}", parse_math=False)
            axes.label_outer()
            groups = _alike(curves)
            # lower lines are wider, so that they are visible where lines overlap
            for group, width in zip(groups, np.linspace(3.8, 1.4, len(groups)), strict=True):
                _draw_striped(axes, curves, group, styles, width)
        figure.legend(
            handles=[
                Line2D([], [], color=styles[r.planner].colour, lw=2.4, ls="-" if r.success else ":")
                for r in runs
            ],
            labels=[_entry(run) for run in runs],
            title="stripes: planners with the same path; dotted: failed",
            title_fontsize=7.5,
            loc="outside lower center",
            ncols=3,
            frameon=False,
            fontsize=7.5,
            handlelength=2.0,
        )


def _entry(run: Run) -> str:
    if run.length is None:
        return f"{run.planner}: {run.status.replace('_', ' ')}"
    gap = "" if run.gap is None else f" (+{100 * max(run.gap, 0.0):.2f} %)"
    return f"{run.planner}: {run.length:.2f} m{gap}"


def _alike(curves: Mapping[str, Array]) -> list[list[str]]:
    """Groups of planners with nearly the same curve; large groups, then long curves first."""
    even = {name: _even(points) for name, points in curves.items()}
    groups: list[list[str]] = []
    for name, points in even.items():
        for group in groups:
            if np.linalg.norm(points - even[group[0]], axis=1).max() <= _ALIKE:
                group.append(name)
                break
        else:
            groups.append([name])
    return sorted(groups, key=lambda group: (-len(group), -_along(curves[group[0]])[-1]))


def _along(points: Array) -> Array:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _even(points: Array) -> Array:
    """200 points evenly spaced along a curve (n, 2)."""
    along = _along(points)
    at = np.linspace(0.0, along[-1], 200)
    return np.column_stack([np.interp(at, along, axis) for axis in points.T])


def _draw_striped(
    axes: Axes,
    curves: Mapping[str, Array],
    group: Sequence[str],
    styles: Mapping[str, Style],
    width: float,
) -> None:
    points = curves[group[0]]
    for k, name in enumerate(group):
        style: Any = "-"
        if k > 0:  # on top of the first, which is solid; in units of the line width
            dash = _DASH / width
            style = (-k * dash, (dash, (len(group) - 1) * dash))
        look: Any = {"color": styles[name].colour, "ls": style, "lw": width, "zorder": 4}
        axes.plot(*points.T, dash_capstyle="butt", solid_joinstyle="round", **look)
