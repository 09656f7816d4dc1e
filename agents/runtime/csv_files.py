"""Tables of comma-separated values, written atomically."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ferguson_gym.runtime import atomic_write


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table atomically."""
    with csv_table(path, columns) as writer:
        writer.writerows(rows)


@contextmanager
def csv_table(path: Path, columns: Sequence[str]) -> Iterator[Any]:
    """Yield a writer of rows; the file appears when the block ends."""
    with (
        atomic_write(path) as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        yield writer
