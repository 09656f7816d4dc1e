"""The picture of `paper_claims.py`: each claim a panel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from paper_claims_variants import Row

from agents.flights.metrics import Interval
from ferguson_gym.rendering.drawing import style
from ferguson_gym.runtime.atomic_files import atomic_write

INK, TIME = "#0b5fa5", "#e07b00"
RATIOS = (0.25, 0.5, 1.0, 2.0, 4.0)


def draw(table: Sequence[Row], out: Path) -> None:
    """Write the picture, in the format of the path's suffix."""
    groups = list(dict.fromkeys(row.group for row in table))
    with mpl.rc_context(style()):
        figure = Figure(figsize=(9.2, 1.05 + 0.2 * len(table) + 0.35 * len(groups)))
        FigureCanvasAgg(figure)
        figure.set_layout_engine("constrained", h_pad=0.03, w_pad=0.03)
        heights = [1.0 + sum(row.group == group for row in table) for group in groups]
        grid = figure.subplots(len(groups), 4, squeeze=False, height_ratios=heights)
        for axes, group in zip(grid, groups, strict=True):
            members = [row for row in table if row.group == group]
            _points(axes[0], members, lambda row: (100 * row.success, _in(row.success_interval)))
            _points(axes[1], members, lambda row: (100 * row.longer, _in(row.longer_interval)))
            _points(axes[2], members, lambda row: (row.slower, row.slower_interval), TIME)
            _points(axes[3], members, lambda row: (row.spl, row.spl_interval))
            axes[0].set_yticks(range(len(members)), [row.variant for row in members])
            axes[0].set_title(group, loc="left", fontweight="bold")
            axes[0].set_xlim(0.0, 102.0)
            axes[2].set_xscale("log")
            axes[2].set_xlim(0.25, 4.0)
            axes[2].set_xticks(RATIOS, [f"{ratio:g}" for ratio in RATIOS], minor=False)
            axes[2].minorticks_off()
            axes[3].set_xlim(0.0, 1.02)
            axes[1].axvline(0.0, color="#bbbbbb", lw=0.8, zorder=0)
            axes[2].axvline(1.0, color="#bbbbbb", lw=0.8, zorder=0)
        names = ("success [%]", "longer than the reference [%]", "time a window, ratio", "SPL")
        for axes, name in zip(grid[-1], names, strict=True):
            axes.set_xlabel(name)
        with atomic_write(out) as temporary:
            figure.savefig(temporary)


def _in(interval: Interval | None) -> Interval | None:
    """An interval of shares in percent."""
    return interval and Interval(100 * interval.low, 100 * interval.high)


def _points(
    axes: Axes,
    members: Sequence[Row],
    value: Callable[[Row], tuple[float, Interval | None]],
    colour: str = INK,
) -> None:
    for place, row in enumerate(members):
        middle, interval = value(row)
        if interval is not None:
            axes.plot(interval, (place, place), color=colour, lw=1.4, alpha=0.6)
        axes.plot(middle, place, "o", color=colour, ms=4)
    axes.set_ylim(len(members) - 0.4, -0.6)
    axes.set_yticks(range(len(members)), [""] * len(members))
    axes.tick_params(length=0, axis="y")
    axes.grid(axis="x", color="#eeeeee", zorder=0)
    axes.set_axisbelow(True)
    for spine in ("top", "right", "left"):
        axes.spines[spine].set_visible(False)
