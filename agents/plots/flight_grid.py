"""Figures of flights side by side, one panel each, in the style of a paper."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D

from agents.flights import Flight
from agents.plots.figure import figure_file
from ferguson_gym.curves import evaluate
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import unwritable

SUFFIXES = (".png", ".pdf", ".svg")
"""File formats of pictures."""
_WINDOWS = 3
"""Upper limit of the planned horizons drawn in each panel."""
_ABANDONED = 0.5
"""Distance [m] from the end of a planned horizon to the flight, above which it was abandoned."""


def check_target(path: Path, what: str = "picture", suffixes: Sequence[str] = SUFFIXES) -> None:
    """Check that a file can be written in one of the formats; errors call it `what`.

    Raises:
        ValueError: the format is unknown, the path is a directory, or its directory does not exist
            or cannot be written to.
    """
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"{what}s are written as {', '.join(suffixes)}, not {path.name!r}")
    if "\0" in str(path):
        raise ValueError(f"the {what}'s name holds a character that no file's may: {str(path)!r}")
    if path.is_dir():
        raise ValueError(f"the {what} {path} is a directory")
    if not path.parent.is_dir():
        raise ValueError(f"no such directory for the {what}: {path.parent}")
    if (reason := unwritable(path.parent)) is not None:
        raise ValueError(f"cannot write the {what} in {path.parent.resolve()}: {reason}")


def picture_of(policy: str) -> str:
    """File name of a policy's picture, without the slashes of a path."""
    return re.sub(r"[/\\]", "-", policy) + ".png"


def draw_flights(flights: Sequence[Flight], path: Path, title: str = "") -> None:
    """Write a grid of flights, one panel each; the suffix of the path decides the format."""
    columns = min(len(flights), 2)
    rows = -(-len(flights) // columns)
    with figure_file(path, 3.5 * columns, 3.62 * rows + 0.45) as figure:
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes, flight in zip(grid.flat, flights, strict=False):
            _draw_panel(axes, flight)
        alike = len({flight.field.bounds.tobytes() for flight in flights}) == 1
        if alike and len(flights) == rows * columns:
            for axes in grid.flat:
                axes.label_outer()
        for axes in list(grid.flat)[len(flights) :]:
            axes.set_visible(False)
        if title:
            figure.suptitle(title, fontsize=10, parse_math=False)
        entries = _legend(flights)
        figure.legend(
            handles=list(entries.values()),
            labels=list(entries),
            handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)},
            loc="outside lower center",
            ncols=len(entries) if columns > 1 or len(entries) == 4 else 3,
            frameon=False,
            fontsize=7,
            handlelength=2.4,
            columnspacing=1.2,
        )


def _draw_panel(axes: Axes, flight: Flight) -> None:
    drawing.draw_field(axes, flight.field)
    drawing.draw_horizons(axes, _horizons(flight))
    drawing.draw_path(axes, flight.control)
    if flight.refused is not None:
        drawing.draw_refused(axes, flight.refused)
    title = f"{flight.field.name}: {len(flight.control)} segments, {flight.length:.2f} m"
    if flight.gap is not None:
        title += f", gap {100 * flight.gap:.2f} %"
    if not flight.success:
        title += f"\n{flight.outcome.sentence}"
    axes.set_title(title, parse_math=False)


def _horizons(flight: Flight) -> list[Array]:
    """The planned horizons whose ends are farthest from the flight."""
    chains = flight.windows
    if not chains:
        return []
    flown = evaluate(flight.control, np.linspace(0.0, 1.0, 30)).reshape(-1, 2)
    ends = np.array([chain[-1, 1] for chain in chains])
    aside = np.linalg.norm(ends[:, None] - flown, axis=-1).min(axis=1)
    order = np.argsort(-aside, kind="stable")[:_WINDOWS]
    return [chains[k] for k in order if aside[k] > _ABANDONED]


def _legend(flights: Sequence[Flight]) -> dict[str, Line2D | tuple[Line2D, ...]]:
    entries: dict[str, Line2D | tuple[Line2D, ...]] = {
        "start": Line2D([], [], color=drawing.START, marker="o", ls="", ms=5),
        "goal": Line2D([], [], color=drawing.GOAL, marker="*", ls="", ms=8),
        "segments": tuple(Line2D([], [], color=color, lw=1.8) for color in drawing.SEGMENTS),
        "knots": Line2D([], [], mfc="white", mec="#333333", marker="o", ls="", ms=3),
    }
    if any(_horizons(flight) for flight in flights):
        entries["planned, then abandoned"] = Line2D([], [], color=drawing.HORIZON, ls="--", lw=0.9)
    if any(flight.refused is not None for flight in flights):
        entries["refused"] = Line2D([], [], color=drawing.REFUSED, ls=":", lw=1.6)
    return entries
