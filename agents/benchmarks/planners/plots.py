"""Figures of a comparison of planners: paths, progress in time, performance profiles."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from agents.benchmarks.planners.path_plot import draw_paths, most_different_runs
from agents.benchmarks.planners.runs import Run
from agents.benchmarks.planners.styles import Style, styles_of
from agents.flights.metrics import best_so_far, quantile, share_within
from agents.plots.figure import figure_file
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths import gap

LEAST_GAP = 1e-5
"""Smaller gaps are drawn as this one on a logarithmic axis."""


def draw(runs: Sequence[Run], directory: Path) -> None:
    """Write paths.png, progress.png and profiles.png."""
    styles = styles_of(list(dict.fromkeys(run.planner for run in runs)))
    draw_paths(most_different_runs(runs), styles, directory / "paths.png")
    draw_progress(runs, styles, directory / "progress.png")
    draw_profiles(runs, styles, directory / "profiles.png")


def draw_progress(runs: Sequence[Run], styles: Mapping[str, Style], path: Path) -> None:
    """Draw the median gap of the best route over time, and the gap of the final path.

    Runs without a route so far have an infinite gap: a line begins when half of all runs have
    one. Planners that never improve their first route have no line.
    """
    with figure_file(path, 7.0, 3.9) as figure:
        axes = figure.subplots()
        known = [run for run in runs if run.exact_length is not None]
        handles = [
            _draw_progress_of(axes, [run for run in known if run.planner == name], name, style)
            for name, style in styles.items()
        ]
        axes.set(xscale="log", yscale="log", xlabel="time [s]", ylabel="gap, median of all runs")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_major_formatter(_PER_CENT)
        _finish(figure, axes, handles)
        axes.set_title("lines: best route so far; points: certified path at the end of planning")


def _draw_progress_of(axes: Axes, mine: Sequence[Run], name: str, style: Style) -> Line2D:
    """Draw one planner's line and point; returns its entry in the legend."""
    times = gaps = np.empty(0)
    if any(run.improved for run in mine):
        times, gaps = median_progress(mine)
        gaps = np.maximum(gaps, LEAST_GAP)
        axes.step(times, gaps, where="post", color=style.colour)
    end = quantile([run.seconds for run in mine], 0.5)
    reached = quantile([np.inf if run.gap is None else run.gap for run in mine], 0.5)
    label = name
    if end is None or reached is None or np.isinf(reached):
        label += " (mostly fails)"
    else:
        reached = max(reached, LEAST_GAP)
        if len(times):
            axes.plot([times[-1], end], [gaps[-1], reached], ":", color=style.colour, lw=1.0)
        axes.plot(end, reached, **style.spot)
    return Line2D([], [], ls="-" if len(times) else "", label=label, **style.spot)


_PER_CENT = FuncFormatter(
    lambda value, _: f"≤ {100 * value:g} %" if value <= LEAST_GAP else f"{100 * value:g} %"
)


def median_progress(runs: Sequence[Run]) -> tuple[Array, Array]:
    """Times (n,) [s], and the median over runs of the best route's gap at each (n,).

    They begin when half of the runs have a route and end when half of the plans are finished. All
    runs need an exact length.
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


def draw_profiles(runs: Sequence[Run], styles: Mapping[str, Style], path: Path) -> None:
    """Draw the share of runs with a gap of at most x; failures have none."""
    known = [run for run in runs if run.exact_length is not None]
    ends = [max(run.gap, LEAST_GAP) for run in known if run.gap is not None]
    levels = np.geomspace(LEAST_GAP, max([10.0 * LEAST_GAP, *ends]) * 1.15, 600)
    with figure_file(path, 7.0, 3.9) as figure:
        axes = figure.subplots()
        handles: list[Line2D] = []
        for name, style in styles.items():
            gaps = [run.gap for run in known if run.planner == name]
            share = 100.0 * share_within(gaps, levels)
            axes.step(levels, share, where="post", color=style.colour)
            # shifted markers, so that those of overlapping lines are all visible
            some = slice(5 * len(handles) + 10, None, 75)
            axes.plot(levels[some], share[some], ls="", **style.spot)
            label = f"{name} {sum(gap is not None for gap in gaps)}/{len(gaps)}"
            handles.append(Line2D([], [], label=label, **style.spot))
        axes.set(
            xscale="log",
            xlim=(levels[0], levels[-1]),
            ylim=(-1.0, 101.0),
            xlabel="gap of at most",
            ylabel="runs solved [%]",
        )
        axes.xaxis.set_major_formatter(_PER_CENT)
        _finish(figure, axes, handles)


def _finish(figure: Figure, axes: Axes, handles: Sequence[Line2D]) -> None:
    axes.grid(color="#e6e9ee", lw=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.legend(handles=list(handles), loc="outside right upper", frameon=False, fontsize=7.5)
