"""A resumable directory of finished chunks: work that survives an interruption.

A request is cut into chunks whose results are arrays. Each chunk is one file, written atomically,
so the chunks do not depend on which process computes them or how often the work is interrupted.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from agents.runtime.safe_npz import read_arrays
from ferguson_gym.runtime import atomic_write

START_OVER = "choose another --out, or start over with --fresh"
_REQUEST = "request.json"
_MOST_CHARACTERS = 120
"""Limit on the length of a value in a message."""
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class ChunkStore:
    """The finished chunks of one request."""

    place: Path
    """The directory."""
    request: Mapping[str, Any]
    """JSON values that identify the request."""
    number: int
    """Number of chunks."""
    digits: int = 6
    """Digits of a chunk's number in its file name."""

    @cached_property
    def digest(self) -> str:
        """Short hash of the request."""
        return hashlib.sha256(json.dumps(self.request, sort_keys=True).encode()).hexdigest()[:12]

    def file(self, chunk: int) -> Path:
        """Path of a chunk."""
        # the digest: a worker that outlives a killed run must not write into another's chunks
        return self.place / f"chunk-{self.digest}-{chunk:0{self.digits}d}.npz"

    def holds_work(self) -> bool:
        """Whether the directory holds unfinished work of this request.

        Raises:
            ValueError: It holds work of another request, or of an unknown one.
        """
        # a run may have been stopped while it wrote its first file
        if all(path.name.startswith(".") for path in self.place.glob("*")):
            return False
        found = read_json(self.place / _REQUEST)
        refuse_other(found, self.request, f"unfinished work at {self.place}")
        return True

    def begin(self) -> list[int]:
        """Make the directory, or resume its work; returns the chunks that are missing.

        Raises:
            ValueError: As `holds_work`.
        """
        if not self.holds_work():
            self.place.mkdir(parents=True, exist_ok=True)
            with atomic_write(self.place / _REQUEST) as temporary:
                temporary.write_text(json.dumps(self.request), encoding="utf-8")
        return [chunk for chunk in range(self.number) if not self.file(chunk).exists()]

    def write(self, chunk: int, arrays: Mapping[str, Any]) -> None:
        """Write the arrays of a finished chunk."""
        with atomic_write(self.file(chunk)) as temporary:
            np.savez(temporary, allow_pickle=False, **arrays)

    def read(self, chunk: int, parse: Callable[[dict[str, Any]], T]) -> T:
        """Read a chunk; `parse` makes the result of its arrays, or raises ValueError.

        Raises:
            OSError: The chunk cannot be read, or it is damaged.
        """
        path = self.file(chunk)
        try:
            return parse(read_arrays(path))
        except ValueError as error:
            raise OSError(f"{path} is damaged ({error}): remove it, and run again") from None

    def remove(self) -> None:
        """Remove the directory, renamed first: half of it would count as unfinished work."""
        gone = self.place.with_name(f"{self.place.name}-gone")
        shutil.rmtree(gone, ignore_errors=True)
        if self.place.exists():
            self.place.rename(gone)
            shutil.rmtree(gone)


def read_json(path: Path) -> dict[str, Any]:
    """The JSON object in a file; empty if the file is missing or holds something else."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def refuse_other(found: object, wanted: Mapping[str, Any], what: str) -> None:
    """Refuse work or results (`what`, for the message) of another request.

    Raises:
        ValueError: The request on disk is not the wanted one; the message names what differs.
    """
    if not isinstance(found, dict) or not found:
        raise ValueError(f"{what} does not say how it was made; {START_OVER}")
    before, now = _flat(found), _flat(wanted)
    changes = [
        f"{key} was {_shorten(before.get(key))}, now {_shorten(now.get(key))}"
        for key in now | before
        if before.get(key) != now.get(key)
    ]
    if changes:
        raise ValueError(f"{what} is of another configuration ({'; '.join(changes)}); {START_OVER}")


def _flat(entries: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Entries of nested mappings by dotted path."""
    flat: dict[str, Any] = {}
    for key, value in entries.items():
        nested = isinstance(value, Mapping) and value
        flat |= _flat(value, f"{prefix}{key}.") if nested else {f"{prefix}{key}": value}
    return flat


def _shorten(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."
