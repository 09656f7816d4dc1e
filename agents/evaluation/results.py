"""An evaluation on disk: flights.csv, timings.csv and paths.npz, written flight after flight."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from agents.evaluation.records import Record
from agents.runtime.csv_files import csv_table
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write

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
"""Columns of timings.csv. Decisions have no times where they were taken in a batch, whose flights
have equal shares of its seconds."""


def flight_row(flight: Record) -> list[object]:
    """A row of flights.csv; what does not exist is an empty cell."""
    return [
        flight.policy,
        flight.field,
        flight.seed,
        flight.outcome.label,
        int(flight.success),
        repr(flight.length),
        "" if flight.exact_length is None else repr(flight.exact_length),
        "" if flight.gap is None else repr(flight.gap),
        repr(flight.clearance),
        flight.segments,
        repr(flight.min_turn_radius) if math.isfinite(flight.min_turn_radius) else "inf",
    ]


def timing_row(flight: Record) -> list[object]:
    """A row of timings.csv; what was not measured is an empty cell."""
    asked = flight.decision_seconds
    return [
        flight.policy,
        flight.field,
        flight.seed,
        f"{np.median(asked):.6f}" if len(asked) else "",
        f"{asked.max():.6f}" if len(asked) else "",
        f"{flight.seconds:.6f}",
    ]


def write_flights(directory: Path, flights: Iterable[Record]) -> Iterator[Record]:
    """Write flights.csv and timings.csv into a directory that exists, and pass the flights on."""
    with (
        csv_table(directory / "flights.csv", FLIGHT_COLUMNS) as rows,
        csv_table(directory / "timings.csv", TIMING_COLUMNS) as times,
    ):
        for flight in flights:
            rows.writerow(flight_row(flight))
            times.writerow(timing_row(flight))
            yield flight


def write_paths(path: Path, flights: Sequence[Record], controls: Iterable[Array]) -> None:
    """Write paths.npz whole; the same flights give the same file.

    Args:
        path: where.
        flights: all.
        controls: their segments (n, 4, 2), or several flights' together, in the same order.
    """
    offsets = np.cumsum([0, *(flight.segments for flight in flights)])
    with (
        atomic_write(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        with _entry(archive, "control") as file:
            shape = (int(offsets[-1]), 4, 2)
            header = {"descr": "<f8", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(file, header)
            for control in controls:
                file.write(np.ascontiguousarray(control, "<f8").tobytes())
        rest: dict[str, NDArray[Any]] = {
            "offsets": offsets,
            "policy": np.array([flight.policy for flight in flights]),
            "field": np.array([flight.field for flight in flights]),
            "seed": np.array([flight.seed for flight in flights]),
        }
        for key, values in rest.items():
            with _entry(archive, key) as file:
                np.lib.format.write_array(file, values, allow_pickle=False)


@contextmanager
def _entry(archive: zipfile.ZipFile, name: str) -> Iterator[IO[bytes]]:
    # of no date, so that equal contents make equal files
    entry = zipfile.ZipInfo(f"{name}.npy")
    entry.compress_type = zipfile.ZIP_DEFLATED
    with archive.open(entry, "w", force_zip64=True) as file:
        yield file
