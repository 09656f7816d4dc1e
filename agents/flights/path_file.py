"""Paths as files for other programs: points at even distances, as CSV or JSON."""

from __future__ import annotations

import json
from pathlib import Path as FilePath

from agents.runtime.csv_files import write_csv
from ferguson_gym.curves import Path, PathSamples
from ferguson_gym.runtime import atomic_write

SUFFIXES = (".csv", ".json")
"""File formats of paths."""
COLUMNS = ("distance", "x", "y", "heading", "curvature")
"""Of a CSV file: distance along the path [m], position [m], heading [rad], curvature [1/m]."""


def write_path(path: Path, samples: PathSamples, file: FilePath) -> None:
    """Write points of a planar path; the suffix of the file decides the format.

    A JSON file holds the columns of `COLUMNS` as lists, and the control array, from which
    `Path.load` reads the path itself.

    Raises:
        OSError: the file cannot be written; an older file is then still there.
    """
    x, y = samples.position.T
    columns = [samples.distance, x, y, samples.heading, samples.curvature]
    if file.suffix.lower() == ".csv":
        write_csv(file, COLUMNS, zip(*(column.tolist() for column in columns), strict=True))
        return
    data = {name: column.tolist() for name, column in zip(COLUMNS, columns, strict=True)}
    with atomic_write(file) as temporary:
        text = json.dumps({**data, "control": path.control.tolist()}, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
