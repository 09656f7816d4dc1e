"""The picture at the top of the README: the task, the optimiser's horizon, the agent's eyes.

Run it from a checkout:

    .venv/bin/python benchmarks/overview_picture.py --out docs/images/overview.png
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from agents.flights.flight import Flight, fly
from agents.models import loading, shipped_agents
from agents.models.model import Model
from agents.policies.lookahead import LASTING, SPREAD
from agents.policies.spec import PolicySpec
from ferguson_gym.curves.path import Path as Flown
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.world import transition as flight
from ferguson_gym.world.actions import decode
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field

FIELD = "standard/validation:8"
OPTIMISER, AGENT, EXACT = "multi-start", "dagger-ppo+tries=32", "guided"
COLOURS = {EXACT: "#1b9e77", OPTIMISER: "#0b5fa5", AGENT: "#e07b00"}
STEP, LATER = 4, 3
"""Segments flown where the optimiser and the agent are shown."""
TRIES = 32
"""Flights imagined in the picture; the agent imagines as many, from the start."""
SIDE, APART, TITLE, BELOW = 3.0, 0.14, 0.28, 0.76
"""Of panels: side, room between them, titles, lines below [in]."""
SEGMENT, RAYS = drawing.SEGMENTS[0], "#d9a441"
_T = np.linspace(0.0, 1.0, 40)
_SHORTEST: dict[str, Any] = {"color": "black", "ls": (0, (1, 1.6)), "lw": 1.1}


def draw(out: Path) -> None:
    """Fly, and write the picture."""
    flights = {name: fly(name, get_field(FIELD), 0) for name in (EXACT, OPTIMISER, AGENT)}
    width, height = 3 * (SIDE + APART) + APART, TITLE + SIDE + BELOW
    with mpl.rc_context(drawing.style()):
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        panels = []
        for k in range(3):
            left = APART + k * (SIDE + APART)
            box = (left / width, BELOW / height, SIDE / width, SIDE / height)
            panels.append(figure.add_axes(box))
        _task(panels[0], list(flights.values()))
        _horizon(panels[1], flights[OPTIMISER])
        _imagination(panels[2], flights[AGENT])
        with atomic_write(out) as temporary:
            figure.savefig(temporary)


def _task(axes: Axes, flights: Sequence[Flight]) -> None:
    """The field, its shortest path, everyone's flight."""
    field = flights[0].field
    _begin(axes, flights[0], "A field, its exact optimum, and three flights")
    path = shortest_path(field)
    assert path is not None
    handles = []
    for k, flown in enumerate(flights):
        look = {"color": COLOURS[flown.policy], "lw": 4.2 - 1.3 * k}
        axes.plot(*Flown(flown.control).points().T, zorder=4, solid_capstyle="round", **look)
        assert flown.gap is not None
        told = f"{flown.policy}: {flown.length:.2f} m, {100 * flown.gap:+.2f} %"
        handles.append(Line2D([], [], label=told, **look))
    axes.plot(*path.points(0.5).T, zorder=7, **_SHORTEST)
    told = f"shortest path, exact: {path.length:.2f} m"
    _explain(axes, [Line2D([], [], label=told, **_SHORTEST), *handles])


def _horizon(axes: Axes, flight: Flight) -> None:
    """One window of the optimiser."""
    decision = flight.decisions[STEP]
    assert decision.chain is not None
    _begin(axes, flight, "The optimiser: plan three segments, fly one")
    drawing.draw_path(axes, flight.control[:STEP])
    guesses = [evaluate(chain, _T).reshape(-1, 2) for _, chain in decision.candidates]
    thin: dict[str, Any] = {"color": drawing.HORIZON, "lw": 0.8, "alpha": 0.5}
    axes.add_collection(
        LineCollection(guesses, colors=drawing.HORIZON, lw=0.8, alpha=0.5, zorder=3), autolim=False
    )
    thick: dict[str, Any] = {"color": drawing.HORIZON, "lw": 2.2}
    axes.plot(*evaluate(decision.chain, _T).reshape(-1, 2).T, zorder=4, **thick)
    knots: dict[str, Any] = {"marker": "o", "mfc": "white", "mec": drawing.HORIZON, "ms": 3.6}
    axes.plot(*decision.chain[:, 1].T, zorder=5, ls="", **knots)
    _explain(
        axes,
        [
            Line2D([], [], label="flown, segment by segment (blue, orange)", color=SEGMENT, lw=1.8),
            Line2D([], [], label=f"first guesses ({len(guesses)})", **thin),
            Line2D([], [], label="the window kept: its first segment is flown", **thick, **knots),
        ],
    )


def _imagination(axes: Axes, flown: Flight) -> None:
    """What the agent sees from where it is, and how it might go on."""
    field = flown.field
    _begin(axes, flown, "The agent: what it sees and imagines")
    place = shipped_agents.find_agent(PolicySpec.parse(AGENT).agent)
    assert place is not None
    model = loading.load(place)
    last = flown.control[LATER - 1]
    vehicle = flight.State(position=last[1], derivative=last[3], segments=LATER)
    seen = observe_one(field, vehicle, model.settings)
    ranges = model.settings.view * seen["rays"]
    heading = float(np.arctan2(*vehicle.derivative[::-1]))
    angles = heading + 2 * np.pi * np.arange(len(ranges)) / len(ranges)
    tips = vehicle.position + ranges[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    rays = [np.stack([vehicle.position, tip]) for tip in tips]
    eyes: dict[str, Any] = {"lw": 0.5, "alpha": 0.8}
    axes.add_collection(LineCollection(rays, colors=RAYS, zorder=1, **eyes), autolim=False)
    drawing.draw_path(axes, flown.control[:LATER])
    thin: dict[str, Any] = {"lw": 0.8, "alpha": 0.9}
    curves = _imagined(model, field, vehicle)
    axes.add_collection(
        LineCollection(curves, colors=drawing.HORIZON, zorder=3, **thin), autolim=False
    )
    axes.plot(*vehicle.position, "o", color="black", ms=4, zorder=6)
    _explain(
        axes,
        [
            Line2D([], [], label=f"rays, {len(ranges)}; discs nearby are seen too", color=RAYS),
            Line2D(
                [],
                [],
                label="flown, an answer a segment (blue, orange)",
                color=SEGMENT,
            ),
            Line2D([], [], label="imagined; the shortest is flown", color=drawing.HORIZON, **thin),
        ],
    )


def _imagined(model: Model, field: Field, vehicle: flight.State) -> list[Array]:
    """Flights from a state on, as `agents.policies.lookahead` imagines them, as points."""
    flights = SimulatedRollouts(
        [field], np.zeros(TRIES, np.int64), [vehicle] * TRIES, model.settings
    )
    states = [(vehicle.position, vehicle.derivative)] * TRIES
    curves: list[list[Array]] = [[] for _ in range(TRIES)]
    stream = np.random.default_rng(0)
    perturbations = np.zeros((TRIES, 4))
    while len(which := flights.active):
        fresh = stream.normal(size=(len(which), 4))
        perturbations = LASTING * perturbations + np.sqrt(1.0 - LASTING**2) * fresh
        wild = np.linspace(0.0, SPREAD, TRIES)[which, None] * perturbations
        actions = np.clip(model.network.act(flights.observations) + wild, -1.0, 1.0).astype(
            np.float32
        )
        flights.step(actions)
        feasible = flights.flying | flights.arrived
        for k, action, fine in zip(which.tolist(), actions, feasible, strict=True):
            if fine:
                control = decode(action, *states[k], field.goal, field.limits.gate)
                states[k] = control[1], control[3]
                curves[k].append(evaluate(control, _T))
        perturbations = perturbations[flights.flying]
        flights.keep(flights.flying)
    return [np.concatenate(curve) for curve in curves if curve]


def _begin(axes: Axes, flight: Flight, title: str) -> None:
    drawing.draw_field(axes, flight.field)
    axes.tick_params(labelbottom=False, labelleft=False)
    axes.set_title(title, fontsize=9)


def _explain(axes: Axes, handles: Sequence[Line2D]) -> None:
    legend = axes.legend(
        handles=list(handles),
        loc="upper left",
        bbox_to_anchor=(-0.02, 0.0),
        fontsize=7.5,
        frameon=False,
        labelspacing=0.3,
        handlelength=2.0,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


def main() -> None:
    """Read the command line, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE")
    draw(parser.parse_args().out)


if __name__ == "__main__":
    main()
