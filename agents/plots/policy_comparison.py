"""A figure of several policies on the same fields: one panel per field, with its shortest path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from agents.flights import Flight
from agents.plots.figure import figure_file
from agents.policies import PolicySpec
from ferguson_gym.curves import evaluate
from ferguson_gym.rendering.drawing import draw_field
from ferguson_gym.shortest_paths import shortest_path

COLOURS = ("#0b5fa5", "#e07b00", "#882255", "#56b4e9", "#1b9e77", "#444444", "#b59400")
"""Colours of the policies in order, as in the report; colour-blind readers can tell the first four
apart."""
COLUMNS = 3
"""Upper limit of panels in a row."""
_SIDE, _APART, _TITLE, _LINE = 2.32, 0.11, 0.24, 0.125
"""Side of a panel, space between panels, height of a title and of a line below [in]."""
_SHORTEST: dict[str, Any] = {"color": "black", "ls": (0, (1, 1.6)), "lw": 1.0}
_LETTERS = 39
"""Characters of a 7 pt line that fit below a panel; longer lines get a smaller font."""
_T = np.linspace(0.0, 1.0, 40)


def draw_comparison(panels: Sequence[Sequence[Flight]], out: Path) -> None:
    """Write the figure; the suffix of the path decides the format.

    Each panel has a field's flights of the same policies in the same order.

    Raises:
        ValueError: more policies than there are colours.
    """
    policies = max(len(flights) for flights in panels)
    if policies > len(COLOURS):
        raise ValueError(f"a picture has colours for {len(COLOURS)} policies, got {policies}")
    columns = COLUMNS if len(panels) != 4 else 2
    rows = math.ceil(len(panels) / columns)
    columns = math.ceil(len(panels) / rows)
    below = _LINE * (1 + policies) + _APART
    width = columns * (_SIDE + _APART) + _APART
    height = rows * (_TITLE + _SIDE + below)
    with figure_file(out, width, height, layout=None) as figure:
        for k, flights in enumerate(panels):
            row, column = divmod(k, columns)
            left = _APART + column * (_SIDE + _APART)
            bottom = height - row * (_TITLE + _SIDE + below) - _TITLE - _SIDE
            # placed by hand, since a layout engine would shrink the panels for long lists below
            axes = figure.add_axes((left / width, bottom / height, _SIDE / width, _SIDE / height))
            _draw_panel(axes, flights)


def _draw_panel(axes: Axes, flights: Sequence[Flight]) -> None:
    field = flights[0].field
    draw_field(axes, field)
    axes.tick_params(labelbottom=False, labelleft=False)
    handles: list[Line2D] = []
    if flights[0].exact_length is not None and (path := shortest_path(field)) is not None:
        axes.plot(*path.points(0.5).T, zorder=7, **_SHORTEST)
        handles.append(Line2D([], [], label=f"shortest path: {path.length:.2f} m", **_SHORTEST))
    for k, flight in enumerate(flights):
        # later flights are thinner, so that all are visible where they overlap
        above = len(flights) - 1 - k
        width = 1.2 + min(1.1, 5.5 / len(flights)) * above
        look: dict[str, Any] = {"color": COLOURS[k], "lw": width}
        if len(flight.control):
            points = evaluate(flight.control, _T).reshape(-1, 2)
            axes.plot(*points.T, zorder=4, solid_capstyle="round", **look)
        if not flight.success:
            _draw_failure(axes, flight, COLOURS[k])
        cross = {} if flight.success else _cross(6.0)
        handles.append(Line2D([], [], label=format_flight(flight), **look, **cross))
    axes.set_title(field.name, parse_math=False)
    longest = max(len(str(handle.get_label())) for handle in handles)
    legend = axes.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=(-0.01, 0.0),
        fontsize=7.0 * min(1.0, _LETTERS / longest),
        frameon=False,
        labelspacing=0.25,
        handlelength=1.6,
        borderaxespad=0.2,
        borderpad=0.2,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def _draw_failure(axes: Axes, flight: Flight, colour: str) -> None:
    """Draw a cross where a flight ended, and the segment that was refused."""
    if flight.refused is not None:
        axes.plot(*evaluate(flight.refused, _T).T, ":", color=colour, lw=1.2, zorder=5)
    end = flight.control[-1, 1] if len(flight.control) else flight.field.start
    axes.plot(*end, color=colour, zorder=9, **_cross(8.0))


def _cross(size: float) -> dict[str, Any]:
    return {"marker": "X", "ms": size, "mec": "white", "mew": 0.7}


def format_flight(flight: Flight) -> str:
    """Policy, length and gap or failure of a flight in one line."""
    name = _name(flight.policy)
    if not flight.success:
        return f"{name}: {flight.outcome.label.replace('_', ' ')}, {flight.length:.1f} m"
    gap = flight.gap
    return f"{name}: {flight.length:.2f} m" + ("" if gap is None else f", {100.0 * gap:+.2f} %")


def _name(policy: str) -> str:
    """A policy's name; of a path its last part, or the part before `best` of a training."""
    agent = PolicySpec.parse(policy).agent
    if not agent or not (path := Path(agent)).is_dir():
        return policy
    path = path.resolve()
    return policy.replace(agent, path.parent.name if path.name == "best" else path.name, 1)
