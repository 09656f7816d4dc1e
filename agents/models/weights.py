"""Weights of a model in its `model.zip`: an entry in NumPy's format for each, nothing pickled.

What is read is what was expected: names and shapes are known before, and nothing larger is taken
into memory.
"""

from __future__ import annotations

import math
import re
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TypeAlias

import numpy as np
from numpy.lib import format as npy

from agents.models.inference.activations import Single

Weights: TypeAlias = Mapping[str, Single]
"""By their names in torch."""
Shapes: TypeAlias = Mapping[str, tuple[int, ...]]

MOST = 64_000_000
"""Numbers that a network may have: a small file can claim to hold any."""
_FOLDER, _SUFFIX = "weights/", ".npy"
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Ways of packing that need little memory to unpack, whatever is packed."""
_MAGIC = b"\x93NUMPY\x01\x00"
_LONGEST = 1024
"""Bytes of a header, at most."""
_HEADER = re.compile(
    rb"\{'descr': '<f4', 'fortran_order': False, 'shape': \(([0-9, ]*)\), \} *\n", re.ASCII
)


class _UnfitError(Exception):
    """An entry that is not what was expected; its text says how."""


def entry(name: str) -> str:
    """Where a zip has the weights of this name."""
    return f"{_FOLDER}{name}{_SUFFIX}"


def names(path: Path) -> list[str]:
    """Of the weights in a zip; none in one that has pickled weights alone.

    Raises:
        ValueError: it is no zip, or a damaged one.
    """
    with _opened(path) as archive:
        entries = archive.namelist()
    return [
        name.removeprefix(_FOLDER).removesuffix(_SUFFIX)
        for name in entries
        if name.startswith(_FOLDER) and name.endswith(_SUFFIX)
    ]


def write(archive: zipfile.ZipFile, weights: Weights) -> None:
    """Add weights to a zip; equal weights give equal bytes."""
    for name, value in weights.items():
        info = zipfile.ZipInfo(entry(name))  # without the time
        info.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(info, "w") as file:
            npy.write_array(file, np.asarray(value, "<f4", order="C"), (1, 0), allow_pickle=False)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """A zip to read from."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except _UnfitError as error:
        raise ValueError(
            f"{path}: its weights are not those of the network that model.json describes ({error})"
        ) from None
    except Exception:  # of whatever the library makes of a damaged file
        raise ValueError(f"{path}: not a zip file, or cut short") from None


def read(path: Path, shapes: Shapes) -> dict[str, Single]:
    """The weights of these names and shapes in a zip.

    Raises:
        ValueError: one is missing, of another shape or kind or not finite; there are too many; it
            is no zip, or a damaged one.
    """
    if (count := sum(math.prod(shape) for shape in shapes.values())) > MOST:
        raise ValueError(f"{path}: a network of {count:,} weights; at most {MOST:,} are read")
    with _opened(path) as archive:
        found = {name: _read(archive, name, shape) for name, shape in shapes.items()}
    if not all(np.isfinite(value).all() for value in found.values()):
        raise ValueError(f"{path}: weights that are not finite")
    return found


def _read(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...]) -> Single:
    try:
        info = archive.getinfo(entry(name))
    except KeyError:
        raise _UnfitError(f"{name} is missing") from None
    if info.compress_type not in _PACKED:
        raise _UnfitError(f"{name} is packed in an unusual way")
    size = 4 * math.prod(shape)
    with archive.open(info) as file:
        if (found := _shape(file, name)) != shape:
            raise _UnfitError(f"size mismatch: {name} has the shape {found}, not {shape}")
        numbers = file.read(size + 1)  # beyond the end, where damage is noticed
    if len(numbers) != size:
        raise _UnfitError(f"{name} is shorter or longer than its shape says")
    return np.frombuffer(numbers, "<f4").astype(np.float32).reshape(shape)


def _shape(file: IO[bytes], name: str) -> tuple[int, ...]:
    """Of the array that begins here; its header is read as NumPy writes it, and is not parsed."""
    if file.read(len(_MAGIC)) == _MAGIC:
        length = int.from_bytes(file.read(2), "little")
        if length <= _LONGEST and (header := _HEADER.fullmatch(file.read(length))):
            return tuple(int(digits) for digits in re.findall(rb"[0-9]+", header[1]))
    raise _UnfitError(f"{name} is no array of numbers in single precision")
