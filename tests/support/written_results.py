"""Results directories made by hand, with the files of an evaluation."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from agents.evaluation.results import FLIGHT_COLUMNS
from ferguson_gym.runtime.arrays import Array

EXACT = 140.0
HOSTILE = '</script><script>alert("x")</script><!--<img src=x onerror=alert(1)>'
STRANGE = "/*DATA*/ \u2028 ' \" & ünïcode"


def write_results(
    directory: Path,
    lengths: Mapping[str, Mapping[str, Sequence[float | None]]],
    exact: Mapping[str, float | None] | None = None,
) -> Path:
    """flights.csv and paths.npz of policies by field, a length for each seed; None is a failure."""
    directory.mkdir(exist_ok=True)
    paths = []
    with (directory / "flights.csv").open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(FLIGHT_COLUMNS)
        for policy, fields in lengths.items():
            for field, flown in fields.items():
                shortest = EXACT if exact is None else exact[field]
                for seed, length in enumerate(flown):
                    success = length is not None
                    gap = "" if length is None or shortest is None else length / shortest - 1.0
                    outcome = "goal_reached" if success else "collision"
                    known = "" if shortest is None else shortest
                    row = (outcome, int(success), length or 20.0, known, gap, 0.5, 12, 4.0)
                    rows.writerow((policy, field, seed, *row))
                    paths.append(chain(12 if success else 2, aside=(length or EXACT) - EXACT))
    offsets = np.cumsum([0, *map(len, paths)])
    np.savez(
        directory / "paths.npz",
        control=np.concatenate([np.empty((0, 4, 2)), *paths]),
        offsets=offsets,
    )
    return directory


def chain(number: int, aside: float = 0.0) -> Array:
    """The first of twelve segments (number, 4, 2) from start to goal, in an arc or straight."""
    along = np.linspace(0.0, 1.0, 13)
    bend = aside * np.sin(np.pi * along)
    knots = np.column_stack([100.0 * along + bend, 100.0 * along - bend])
    derivatives = np.gradient(knots, axis=0)
    control = np.stack([knots[:-1], knots[1:], derivatives[:-1], derivatives[1:]], axis=1)
    return control[:number]


def write_three(directory: Path) -> Path:
    """Three policies on four fields: one never fails, one fails once, one always."""
    names = [f"standard/train:{k}" for k in range(3)]
    return write_results(
        directory,
        {
            "sure": {**{name: [150.0] for name in names}, HOSTILE: [170.0]},
            "once": {names[0]: [145.0], names[1]: [None], names[2]: [190.0], HOSTILE: [141.0]},
            STRANGE: {**{name: [None] for name in names}, HOSTILE: [142.0]},
        },
    )
