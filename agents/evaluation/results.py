"""The files of an evaluation, written and read: flights.csv, timings.csv and paths.npz."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from agents.flights.flight_table import TIMES, FlightTable
from agents.runtime.csv_files import write_csv
from agents.runtime.safe_npz import reason
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.atomic_files import atomic_write

KEYS = ("policy", "field", "seed")
_MEASURES = ("length", "exact_length", "gap", "clearance", "segments", "min_turn_radius")
FLIGHT_COLUMNS = (*KEYS, "outcome", "success", *_MEASURES)
"""Columns of flights.csv, none of which depends on a clock."""
TIMING_COLUMNS = (*KEYS, *TIMES)
"""Columns of timings.csv. Decisions of a batch are taken together and have no times of their own;
each of its flights has an equal share of the batch's seconds."""


def write_tables(directory: Path, flights: FlightTable) -> None:
    """Write flights.csv and timings.csv into a directory that exists; NaN is an empty cell."""
    write_csv(directory / "flights.csv", FLIGHT_COLUMNS, flight_rows(flights))
    times = [(f"{value:.6f}" for value in flights[name].tolist()) for name in TIMES]
    cells = ((("" if cell == "nan" else cell) for cell in column) for column in times)
    write_csv(
        directory / "timings.csv",
        TIMING_COLUMNS,
        ((*key, *row) for key, row in zip(_keys(flights), zip(*cells, strict=True), strict=True)),
    )


def flight_rows(flights: FlightTable) -> Iterator[tuple[object, ...]]:
    """Rows of flights.csv."""
    numbers = zip(*(flights[name].tolist() for name in _MEASURES), strict=True)
    for key, outcome, row in zip(_keys(flights), flights.outcomes, numbers, strict=True):
        cells = ("" if math.isnan(value) else repr(value) for value in row)
        yield (*key, outcome.label, int(outcome.success), *cells)


def _keys(flights: FlightTable) -> Iterator[tuple[str, str, int]]:
    for policy, field, seed in zip(flights.policy, flights.field, flights.seed, strict=True):
        yield flights.policies[policy], flights.fields[field], flights.seeds[seed]


def write_paths(path: Path, flights: FlightTable, controls: Iterable[Array]) -> None:
    """Write paths.npz; the same flights give the same file.

    `controls` are the segments (m, 4, 2) of all flights in order, in portions of any size.
    """
    offsets = np.cumsum(np.concatenate([[0], flights["segments"]]))
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
            "policy": np.array(flights.policies)[flights.policy],
            "field": np.array(flights.fields)[flights.field],
            "seed": np.array(flights.seeds)[flights.seed],
        }
        for key, values in rest.items():
            with _entry(archive, key) as file:
                np.lib.format.write_array(file, values, allow_pickle=False)


@contextmanager
def _entry(archive: zipfile.ZipFile, name: str) -> Iterator[IO[bytes]]:
    # without a date, so that equal contents make equal files
    entry = zipfile.ZipInfo(f"{name}.npy")
    entry.compress_type = zipfile.ZIP_DEFLATED
    with archive.open(entry, "w", force_zip64=True) as file:
        yield file


class Paths(Protocol):
    """The paths of all flights, too many to hold at once."""

    @property
    def segments(self) -> NDArray[np.int64]:
        """(n,) number of segments of each flight."""

    def control(self, flights: Iterable[int]) -> dict[int, Array]:
        """Segments (m, 4, 2) of some flights, whose indices ascend."""


@dataclass(frozen=True, slots=True, eq=False)
class StoredPaths:
    """The paths in a paths.npz."""

    path: Path
    segments: NDArray[np.int64]

    def control(self, flights: Iterable[int]) -> dict[int, Array]:
        """Segments (m, 4, 2) of some flights, whose indices ascend.

        Raises:
            ValueError: The file is damaged.
        """
        ends = np.cumsum(self.segments)
        total = int(self.segments.sum())
        with (
            _opened(self.path),
            zipfile.ZipFile(self.path) as archive,
            archive.open("control.npy") as file,
        ):
            np.lib.format.read_magic(file)
            shape, _, kind = np.lib.format.read_array_header_1_0(file)
            if kind != np.float64 or shape != (total, 4, 2):
                raise ValueError(f"control is {shape} of {kind}, and offsets end on {total}")
            size, first = 8 * kind.itemsize, file.tell()
            found = {}
            for k in flights:
                file.seek(first + size * int(ends[k] - self.segments[k]))
                read = file.read(size * int(self.segments[k]))
                found[k] = np.frombuffer(read).reshape(-1, 4, 2)
            return found


def read_paths(path: Path, number: int) -> StoredPaths:
    """The paths of as many flights as flights.csv has.

    Raises:
        ValueError: The file is damaged, or has the paths of another number of flights.
    """
    # opened here: NumPy leaves a file open whose contents are not a zip archive
    with _opened(path), path.open("rb") as file, np.load(file, allow_pickle=False) as data:
        offsets: NDArray[np.int64] = data["offsets"]
        if offsets.ndim != 1 or offsets.dtype.kind != "i" or (np.diff(offsets) < 0).any():
            raise ValueError("offsets are not ascending integers")
        if len(offsets) and offsets[0] != 0:
            raise ValueError("offsets do not begin with 0")
    if len(offsets) != number + 1:
        raise ValueError(
            f"{path} has {len(offsets) - 1} flights and flights.csv has {number}: they are not of "
            "one evaluation"
        )
    return StoredPaths(path, np.diff(offsets))


@contextmanager
def _opened(path: Path) -> Iterator[None]:
    """Turn whatever a library raises on a damaged file into one error that names the file."""
    try:
        yield
    except Exception as error:
        raise ValueError(f"{path} does not hold the paths of flights: {reason(error)}") from None
