"""Pictures of learned agents: how they learned, and how they fly beside others.

Run it from a checkout, after trainings:

    .venv/bin/python benchmarks/agents_picture.py curves --run dagger=runs/dagger \
        --run ppo=runs/ppo --reference multi-start=0.96 --out docs/images/learning.png
    .venv/bin/python benchmarks/agents_picture.py flights --policy guided --policy best \
        --fields standard/validation:0-5 --out docs/images/agents.png

A curve is the `curve.csv` of a training. Its evaluations are drawn as they are, not only the best.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from agents.flights.flight import fly
from agents.plots.flight_grid import check_target
from agents.plots.policy_comparison import COLOURS, draw_comparison
from agents.policies.registry import make_policy
from agents.training.learning_curve import CURVE
from ferguson_gym.rendering.drawing import style
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world.field_names import get_fields

MARKS = "os^Dv*"
"""Of runs, in their order."""
WIDTH = 7.4
"""Of a picture [in]: letters of 8 pt are readable where it is shown 900 pixels wide."""
SHARES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.98, 1.0)
"""Marked on the axis of SPL and success."""
_NEAREST = 0.02
"""How far below 1 the axis stops to stretch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Evaluations of one training, in order."""

    name: str
    minutes: Array
    spl: Array
    success: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """What something that does not learn reaches."""

    name: str
    spl: float
    success: float | None = None


def read_curve(name: str, directory: Path) -> Curve:
    """The curve of a training.

    Raises:
        ValueError: there is none, or nothing in it.
    """
    path = directory / CURVE
    if not path.is_file():
        raise ValueError(f"no {CURVE} in {directory}: need the directory of a training")
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    try:
        minutes, spl, success = (
            np.array([float(row[key]) for row in rows]) for key in ("minutes", "spl", "success")
        )
    except (KeyError, TypeError, ValueError):
        raise ValueError(f"{path}: need numbers in columns minutes, spl and success") from None
    if not rows:
        raise ValueError(f"{path} holds no evaluation yet")
    return Curve(name=name, minutes=minutes, spl=spl, success=success)


def draw_curves(curves: Sequence[Curve], references: Sequence[Reference], out: Path) -> None:
    """SPL and success over time, a line for each training."""
    with _figure(out, WIDTH, 3.3) as figure:
        figure.set_layout_engine("constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        _draw_shares(left, "SPL", [(curve.minutes, curve.spl) for curve in curves])
        _draw_shares(right, "success", [(curve.minutes, curve.success) for curve in curves])
        for reference in references:
            _draw_reference(left, reference.name, reference.spl)
            if reference.success is not None:
                _draw_reference(right, reference.name, reference.success)
        handles = [
            Line2D([], [], color=COLOURS[k], marker=MARKS[k], ms=4, label=curve.name)
            for k, curve in enumerate(curves)
        ]
        _legend(figure, handles)


def _draw_shares(axes: Axes, title: str, lines: Sequence[tuple[Array, Array]]) -> None:
    """Shares over minutes, on an axis that is stretched towards 1."""
    axes.set_yscale("function", functions=(_stretched, _shrunk))
    for k, (minutes, shares) in enumerate(lines):
        axes.plot(
            minutes,
            shares,
            color=COLOURS[k],
            marker=MARKS[k],
            markevery=max(1, math.ceil(len(minutes) / 8)),
            ms=3.5,
            mec="white",
            mew=0.5,
            lw=1.5,
            clip_on=False,
            zorder=4 + k,
        )
    axes.set(xlabel="minutes of training", ylim=(0.0, 1.0), title=title)
    axes.set_xlim(0.0, 1.02 * max(float(minutes[-1]) for minutes, _ in lines))
    axes.set_yticks(SHARES, [f"{share:g}" for share in SHARES])
    axes.minorticks_off()
    axes.grid(axis="y", color="#e3e6ea", lw=0.6)
    axes.spines[["top", "right"]].set_visible(False)


def _draw_reference(axes: Axes, name: str, share: float) -> None:
    axes.axhline(share, color="#555555", ls=":", lw=1, zorder=3)
    axes.annotate(
        f"{name} {share:g}",
        (1.0, share),
        xycoords=("axes fraction", "data"),
        xytext=(0, -2),
        textcoords="offset points",
        ha="right",
        va="top",
        fontsize=7,
        color="#333333",
        parse_math=False,
        zorder=20,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.6},
    )


def _stretched(share: ArrayLike) -> Array:
    return -np.log(1.0 + _NEAREST - np.minimum(share, 1.0))


def _shrunk(height: ArrayLike) -> Array:
    return 1.0 + _NEAREST - np.exp(-np.asarray(height))


def _legend(figure: Figure, handles: Sequence[Line2D]) -> None:
    legend = figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(len(handles), 4),
        frameon=False,
        fontsize=8,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)


@contextmanager
def _figure(out: Path, width: float, height: float) -> Iterator[Figure]:
    with mpl.rc_context(style()):
        figure = Figure(figsize=(width, height))
        FigureCanvasAgg(figure)
        yield figure
        with atomic_write(out) as temporary:
            figure.savefig(temporary)


def _run(text: str) -> tuple[str, Path]:
    name, found, directory = text.partition("=")
    if not (name and found and directory):
        raise argparse.ArgumentTypeError(f"need NAME=DIR, got {text!r}")
    return name, Path(directory)


def _reference(text: str) -> Reference:
    name, _, numbers = text.rpartition("=")
    try:
        shares = [float(number) for number in numbers.split(",")]
    except ValueError:
        shares = []
    if not name or len(shares) not in (1, 2) or not all(0.0 <= share <= 1.0 for share in shares):
        raise argparse.ArgumentTypeError(
            f"need NAME=SPL or NAME=SPL,SUCCESS with numbers from 0 to 1, got {text!r}"
        )
    return Reference(name=name, spl=shares[0], success=shares[1] if len(shares) == 2 else None)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    commands = parser.add_subparsers(dest="command", required=True)
    curves = commands.add_parser("curves", help="SPL and success over minutes of training")
    curves.add_argument("--run", type=_run, action="append", required=True, metavar="NAME=DIR")
    curves.add_argument(
        "--reference", type=_reference, action="append", default=[], metavar="NAME=SPL[,SUCCESS]"
    )
    flights = commands.add_parser("flights", help="policies through the same fields")
    flights.add_argument("--policy", action="append", required=True, metavar="P")
    flights.add_argument("--fields", action="append", required=True, metavar="SPEC")
    flights.add_argument("--seed", type=int, default=0, help="of policies; default: 0")
    for command in (curves, flights):
        command.add_argument("--out", type=Path, required=True, metavar="FILE")
    return parser


def main() -> None:
    """Draw the picture that is asked for."""
    parser = _parser()
    given = parser.parse_args()
    try:
        check_target(given.out)
        if len(given.run if given.command == "curves" else given.policy) > len(COLOURS):
            raise ValueError(f"a picture has colours for {len(COLOURS)}")
        if given.command == "curves":
            curves = [read_curve(name, directory) for name, directory in given.run]
        else:
            fields = [field for spec in given.fields for field in get_fields(spec)]
            for policy in given.policy:
                make_policy(policy)
    except ValueError as error:
        parser.error(str(error))
    if given.command == "curves":
        draw_curves(curves, given.reference, given.out)
    else:
        panels = [[fly(policy, one, given.seed) for policy in given.policy] for one in fields]
        draw_comparison(panels, given.out)
    print(f"wrote {given.out}")


if __name__ == "__main__":
    main()
