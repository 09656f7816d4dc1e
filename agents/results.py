"""An evaluation on disk: flights.csv, timings.csv and paths.npz."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from agents.flights import Flight
from ferguson_gym.files import written_whole

FLIGHT_COLUMNS = (
    "policy",
    "field",
    "seed",
    "outcome",
    "success",
    "length",
    "exact_length",
    "gap",
    "clearance",
    "segments",
    "min_turn_radius",
)
"""Columns of flights.csv: nothing in it that a clock decides."""
TIMING_COLUMNS = (
    "policy",
    "field",
    "seed",
    "decision_seconds_median",
    "decision_seconds_max",
    "seconds",
)
"""Columns of timings.csv."""


def flight_row(flight: Flight) -> list[object]:
    """A row of flights.csv; what does not exist is an empty cell."""
    return [
        flight.policy,
        flight.field.name,
        flight.seed,
        flight.outcome.label,
        int(flight.success),
        repr(flight.length),
        "" if flight.exact_length is None else repr(flight.exact_length),
        "" if flight.gap is None else repr(flight.gap),
        repr(flight.clearance),
        len(flight.control),
        repr(flight.min_turn_radius) if math.isfinite(flight.min_turn_radius) else "inf",
    ]


def timing_row(flight: Flight) -> list[object]:
    """A row of timings.csv."""
    return [
        flight.policy,
        flight.field.name,
        flight.seed,
        f"{np.median(flight.decision_seconds):.6f}",
        f"{max(flight.decision_seconds):.6f}",
        f"{flight.seconds:.6f}",
    ]


def write(directory: Path, flights: Sequence[Flight]) -> None:
    """Write the three files into a directory that exists; each is written whole."""
    write_csv(directory / "flights.csv", FLIGHT_COLUMNS, map(flight_row, flights))
    write_csv(directory / "timings.csv", TIMING_COLUMNS, map(timing_row, flights))
    with written_whole(directory / "paths.npz") as temporary:
        np.savez_compressed(
            temporary,
            control=np.concatenate([np.empty((0, 4, 2)), *(f.control for f in flights)]),
            offsets=np.cumsum([0, *(len(f.control) for f in flights)]),
            policy=np.array([f.policy for f in flights]),
            field=np.array([f.field.name for f in flights]),
            seed=np.array([f.seed for f in flights]),
        )


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table whole or not at all."""
    with (
        written_whole(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
