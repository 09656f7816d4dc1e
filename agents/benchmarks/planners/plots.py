"""Pictures of planners side by side: their paths, gaps in time, performance profiles."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from agents.benchmarks.planners.runs import Run
from agents.flights.metrics import best_so_far, quantile, share_within
from ferguson_gym.curves.path import Path
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.shortest_paths.exact import gap

LEAST_GAP = 1e-5
"""Gaps below are drawn as this one: logarithms have no zero."""
_ALIKE = 1.5
"""Paths that stay within this distance [m], two lines' width, are drawn as one with stripes."""
_DASH = 6.0
"""Length of a stripe [pt]."""
_COLOURS = (
    "#0b5fa5",
    "#e07b00",
    "#1e8449",
    "#c0392b",
    "#8e44ad",
    "#17a2b8",
    "#d63384",
    "#7a5c2e",
    "#9aa50f",
    "#3b3b98",
    "#f4b000",
    "#444444",
    "#f28cb1",
)
"""As many as planners in the catalog, none of them twice."""
_MARKERS = "osD^vP<X>pd8*"


@dataclass(frozen=True, slots=True)
class _Look:
    """How a planner is drawn, alike in all pictures."""

    colour: str
    marker: str
    size: float
    """Of the marker [pt]; the later the smaller, so that points on each other are all seen."""

    @property
    def spot(self) -> dict[str, Any]:
        """Marker and colour as matplotlib takes them."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "ms": self.size,
            "mec": "white",
            "mew": 0.7,
            "zorder": 5,  # above all lines
        }


def draw(runs: Sequence[Run], directory: FilePath) -> None:
    """Write paths.png, progress.png and profiles.png."""
    names = list(dict.fromkeys(run.planner for run in runs))
    looks = {
        name: _Look(
            _COLOURS[k % len(_COLOURS)], _MARKERS[k % len(_MARKERS)], 8.5 - 2.5 * k / len(names)
        )
        for k, name in enumerate(names)
    }
    draw_paths(_most_telling(runs), looks, directory / "paths.png")
    draw_progress(runs, looks, directory / "progress.png")
    draw_profiles(runs, looks, directory / "profiles.png")


def _most_telling(runs: Sequence[Run]) -> list[Run]:
    """The runs of the field and seed with the most different paths, the first of these."""
    together: dict[tuple[str, int], list[Run]] = {}
    for run in runs:
        together.setdefault((run.field.name, run.seed), []).append(run)
    return max(together.values(), key=lambda some: len(_alike(_paths(some))))


def _paths(runs: Sequence[Run]) -> dict[str, Array]:
    return {run.planner: Path(run.control).points() for run in runs if run.success}


@contextmanager
def _figure(path: FilePath, width: float, height: float) -> Iterator[Figure]:
    with mpl.rc_context(drawing.style()):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        yield figure
        with atomic_write(path) as temporary:
            figure.savefig(temporary)


def draw_paths(runs: Sequence[Run], looks: Mapping[str, _Look], path: FilePath) -> None:
    """One field: the routes that planners found, and the paths after the fit."""
    field = runs[0].field
    routes = {run.planner: run.route.points for run in runs if run.route is not None}
    flown = _paths(runs)
    with _figure(path, 7.4, 4.15 + 0.16 * -(-len(runs) // 3)) as figure:
        panels = ((routes, "routes before the fit"), (flown, "certified paths"))
        for axes, (curves, title) in zip(figure.subplots(1, 2), panels, strict=True):
            drawing.draw_field(axes, field)
            axes.set_title(f"{field.name}: {title}", parse_math=False)
            axes.label_outer()
            groups = _alike(curves)
            # what lies lower is wider: it is seen beside what it shares its way with
            for group, width in zip(groups, np.linspace(3.8, 1.4, len(groups)), strict=True):
                _draw_striped(axes, curves, group, looks, width)
        figure.legend(
            handles=[_handle(run, looks[run.planner].colour) for run in runs],
            labels=[_entry(run) for run in runs],
            title="stripes: planners on the same way; dotted: failed",
            title_fontsize=7.5,
            loc="outside lower center",
            ncols=3,
            frameon=False,
            fontsize=7.5,
            handlelength=2.0,
        )


def _handle(run: Run, colour: str) -> Line2D:
    return Line2D([], [], color=colour, lw=2.4, ls="-" if run.success else ":")


def _entry(run: Run) -> str:
    if run.length is None:
        return f"{run.planner}: {run.status.replace('_', ' ')}"
    told = "" if run.gap is None else f" (+{100 * max(run.gap, 0.0):.2f} %)"
    return f"{run.planner}: {run.length:.2f} m{told}"


def _alike(curves: Mapping[str, Array]) -> list[list[str]]:
    """Planners in groups whose curves run together: large groups, then long curves first."""
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
    """200 points at even distances along a curve."""
    along = _along(points)
    at = np.linspace(0.0, along[-1], 200)
    return np.column_stack([np.interp(at, along, axis) for axis in points.T])


def _draw_striped(
    axes: Axes,
    curves: Mapping[str, Array],
    group: Sequence[str],
    looks: Mapping[str, _Look],
    width: float,
) -> None:
    points = curves[group[0]]
    for k, name in enumerate(group):
        style: Any = "-"
        if k > 0:  # over the first, which is whole; in units of the line's width
            dash = _DASH / width
            style = (-k * dash, (dash, (len(group) - 1) * dash))
        axes.plot(
            points[:, 0],
            points[:, 1],
            color=looks[name].colour,
            ls=style,
            lw=width,
            dash_capstyle="butt",
            solid_joinstyle="round",
            zorder=4,
        )


def draw_progress(runs: Sequence[Run], looks: Mapping[str, _Look], path: FilePath) -> None:
    """Median of the best route's gap in time, and the path's gap when planning was over.

    What has found nothing yet has an infinite gap: a line begins when half of all runs have a
    route. Planners that never found a shorter route after their first have no line.
    """
    with _figure(path, 7.0, 3.9) as figure:
        axes = figure.subplots()
        shown: list[Line2D] = []
        for name, look in looks.items():
            mine = [run for run in runs if run.planner == name and run.exact_length is not None]
            times = gaps = np.empty(0)
            if any(run.improved for run in mine):
                times, gaps = median_progress(mine)
                gaps = np.maximum(gaps, LEAST_GAP)
                axes.step(times, gaps, where="post", color=look.colour)
            end = quantile([run.seconds for run in mine], 0.5)
            reached = quantile([np.inf if run.gap is None else run.gap for run in mine], 0.5)
            label = name
            if end is None or reached is None or np.isinf(reached):
                label += " (mostly fails)"
            else:
                reached = max(reached, LEAST_GAP)
                if len(times):
                    axes.plot([times[-1], end], [gaps[-1], reached], ":", color=look.colour, lw=1.0)
                axes.plot(end, reached, **look.spot)
            line = "-" if len(times) else ""
            shown.append(Line2D([], [], ls=line, label=label, **look.spot))
        axes.set(xscale="log", yscale="log", xlabel="time [s]", ylabel="gap, median of all runs")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_major_formatter(_PER_CENT)
        _finish(figure, axes, shown)
        axes.set_title("lines: best route so far; points: certified path, when planning was over")


_PER_CENT = FuncFormatter(
    lambda value, _: f"≤ {100 * value:g} %" if value <= LEAST_GAP else f"{100 * value:g} %"
)


def median_progress(runs: Sequence[Run]) -> tuple[Array, Array]:
    """Times (n,) [s] and the median over runs (n,) of the best route's gap by then.

    From when half of them have a route until half of the plans were over; all runs have an exact
    length.
    """
    progress = [() if run.route is None else run.route.progress for run in runs]
    moments = [when for steps in progress for when, _ in steps]
    over = quantile([run.seconds for run in runs], 0.5) or 0.0
    times = np.unique([*(when for when in moments if when < over), over])
    best = [
        [gap(length, run.exact_length or math.nan) for length in best_so_far(steps, times)]
        for steps, run in zip(progress, runs, strict=True)
    ]
    median = np.quantile(best, 0.5, axis=0, method="inverted_cdf")
    known = np.isfinite(median)
    return times[known], median[known]


def draw_profiles(runs: Sequence[Run], looks: Mapping[str, _Look], path: FilePath) -> None:
    """Share of runs that end with a gap of at most x; a failure never does."""
    known = [run for run in runs if run.exact_length is not None]
    ends = [max(run.gap, LEAST_GAP) for run in known if run.gap is not None]
    levels = np.geomspace(LEAST_GAP, max([10.0 * LEAST_GAP, *ends]) * 1.15, 600)
    with _figure(path, 7.0, 3.9) as figure:
        axes = figure.subplots()
        shown: list[Line2D] = []
        for name, look in looks.items():
            gaps = [run.gap for run in known if run.planner == name]
            share = 100.0 * share_within(gaps, levels)
            axes.step(levels, share, where="post", color=look.colour)
            # markers of planners stand beside each other, where lines lie on each other
            some = slice(5 * len(shown) + 10, None, 75)
            axes.plot(levels[some], share[some], ls="", **look.spot)
            label = f"{name} {sum(gap is not None for gap in gaps)}/{len(gaps)}"
            shown.append(Line2D([], [], label=label, **look.spot))
        axes.set(
            xscale="log",
            xlim=(levels[0], levels[-1]),
            ylim=(-1.0, 101.0),
            xlabel="gap of at most",
            ylabel="runs solved [%]",
        )
        axes.xaxis.set_major_formatter(_PER_CENT)
        _finish(figure, axes, shown)


def _finish(figure: Figure, axes: Axes, shown: Sequence[Line2D]) -> None:
    axes.grid(color="#e6e9ee", lw=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.legend(handles=list(shown), loc="outside right upper", frameon=False, fontsize=7.5)
