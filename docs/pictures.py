"""Pictures of the pages that no command of `ferguson` draws.

Run it from a checkout:

    .venv/bin/python docs/pictures.py observation docs/images/observation.png
    .venv/bin/python docs/pictures.py suites docs/images/suites.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from ferguson_gym.rendering.drawing import (
    HORIZON,
    OBSTACLE_EDGE,
    SEEN,
    draw_field,
    draw_path,
    style,
)
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.suites import SUITES
from ferguson_gym.world.transition import State
from planners.interface import initial_state
from planners.registry import make

_FLOWN = 5
"""Segments flown before the vehicle is looked at."""


def observation() -> Figure:
    """A flight on its way through a field, and what the vehicle sees there."""
    field, settings = get_field("standard/train:3"), Settings(observation="both")
    plan = make("guided").plan(field, initial_state(field), 0)
    vehicle = plan.states[_FLOWN].vehicle
    figure = Figure(figsize=(9.0, 4.7), layout="constrained")
    left, right = figure.subplots(1, 2)
    draw_field(left, field)
    draw_path(left, plan.control[:_FLOWN])
    left.add_patch(Circle(tuple(vehicle.position), settings.view, fill=False, ls=":", ec=HORIZON))
    left.set_title("standard/train:3 after five segments; dotted, how far is seen")
    _draw_seen(right, vehicle, observe_one(field, vehicle, settings), settings)
    return figure


def _draw_seen(axes: Axes, vehicle: State, seen: dict[str, np.ndarray], settings: Settings) -> None:
    """An observation, forward upwards and metres instead of parts of the view."""
    view = settings.view
    ends = view * seen["rays"] * settings.layout.ray_directions
    for forward, aside in ends.T:
        axes.plot([0.0, -aside], [0.0, forward], color=SEEN, lw=0.6, zorder=1)
    axes.plot(-ends[1], ends[0], ".", color=OBSTACLE_EDGE, ms=3, zorder=3)
    for forward, aside, radius, _ in view * seen["obstacles"].reshape(-1, 4)[seen["mask"] > 0.5]:
        axes.add_patch(Circle((-aside, forward), radius, fc=SEEN, ec=OBSTACLE_EDGE, alpha=0.4))
    forward, aside = 0.35 * view * seen["goal"][1:]
    arrow = {"arrowstyle": "->", "color": HORIZON, "lw": 1.6}
    axes.annotate("", (-aside, forward), (0.0, 0.0), arrowprops=arrow, zorder=4)
    axes.text(-aside, forward, "  goal", color=HORIZON, va="bottom")
    axes.plot(0.0, 0.0, marker="^", color="black", ms=8, zorder=5)
    axes.set(xlim=(-35.0, 35.0), ylim=(-35.0, 35.0), aspect="equal")
    axes.set(xlabel="to the right [m]", ylabel="forward [m]")
    rays, discs = len(seen["rays"]), int(seen["mask"].sum())
    axes.set_title(f"what it sees: {rays} rays, the {discs} nearest discs, the goal")


def suites() -> Figure:
    """A field of each suite with its shortest path."""
    figure = Figure(figsize=(13.0, 6.9), layout="constrained")
    every = figure.subplots(2, 4).flat
    every[len(SUITES)].axis("off")
    for axes, suite in zip(every, SUITES, strict=False):
        field = get_field(f"{suite}/train:0")
        draw_field(axes, field)
        if (path := shortest_path(field)) is not None:
            axes.plot(*path.points(0.5).T, color=HORIZON, lw=1.4, ls=":")
            axes.set_title(f"{field.name}, {path.length:.1f} m")
    return figure


PICTURES = {"observation": observation, "suites": suites}


def main() -> None:
    """Draw the picture that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("picture", choices=PICTURES)
    parser.add_argument("out", type=Path, metavar="FILE", help="a .png")
    options = parser.parse_args()
    with mpl.rc_context(style()):
        figure = PICTURES[options.picture]()
        FigureCanvasAgg(figure)
        with atomic_write(options.out) as temporary:
            figure.savefig(temporary, format="png", dpi=110)


if __name__ == "__main__":
    main()
