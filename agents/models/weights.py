"""Weights in `model.zip`: one entry in NumPy's format for each array, nothing pickled.

Names and shapes are known from the card before anything is read, and entries beyond a size limit
are refused.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.lib import format as npy

from agents.models.inference.activations import Float32Array

Weights: TypeAlias = Mapping[str, Float32Array]
"""Arrays by their names in torch."""
Shapes: TypeAlias = Mapping[str, tuple[int, ...]]

MAX_WEIGHTS = 64_000_000
"""Limit on the number of weights: a small file can unpack to any number."""
_FOLDER, _SUFFIX = "weights/", ".npy"


class _MismatchError(Exception):
    """An entry differs from what the card describes; the text says how."""


def entry(name: str) -> str:
    """Name of the zip entry that holds these weights."""
    return f"{_FOLDER}{name}{_SUFFIX}"


def names(path: Path) -> list[str]:
    """Names of the weights in a zip; empty if it has only pickled weights.

    Raises:
        ValueError: The file is not a zip file, or it is damaged.
    """
    with _open_zip(path) as archive:
        entries = archive.namelist()
    return [
        name.removeprefix(_FOLDER).removesuffix(_SUFFIX)
        for name in entries
        if name.startswith(_FOLDER) and name.endswith(_SUFFIX)
    ]


def write(archive: zipfile.ZipFile, weights: Weights) -> None:
    """Add weights to a zip file; equal weights give equal bytes."""
    for name, value in weights.items():
        info = zipfile.ZipInfo(entry(name))  # no time stamp
        info.compress_type = zipfile.ZIP_DEFLATED
        with archive.open(info, "w") as file:
            npy.write_array(file, np.asarray(value, "<f4", order="C"), (1, 0), allow_pickle=False)


@contextmanager
def _open_zip(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a zip file for reading; errors of any type become ValueError."""
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except _MismatchError as error:
        raise ValueError(
            f"{path}: its weights are not those of the network that model.json describes ({error})"
        ) from None
    except Exception:  # the libraries raise errors of many types on a damaged file
        raise ValueError(f"{path}: not a zip file, or damaged") from None


def read(path: Path, shapes: Shapes) -> dict[str, Float32Array]:
    """Read the weights of these names and shapes from a zip.

    Raises:
        ValueError: An array is missing, has another shape or type or is not finite; there are too
            many weights; the file is not a zip file or is damaged.
    """
    if (count := sum(math.prod(shape) for shape in shapes.values())) > MAX_WEIGHTS:
        size = f"a network of {count:,} weights; at most {MAX_WEIGHTS:,} are read"
        raise ValueError(f"{path}: {size}")
    with _open_zip(path) as archive:
        found = {name: _read(archive, name, shape) for name, shape in shapes.items()}
    if not all(np.isfinite(value).all() for value in found.values()):
        raise ValueError(f"{path}: weights that are not finite")
    return found


def _read(archive: zipfile.ZipFile, name: str, shape: tuple[int, ...]) -> Float32Array:
    try:
        info = archive.getinfo(entry(name))
    except KeyError:
        raise _MismatchError(f"{name} is missing") from None
    if info.file_size > 4 * MAX_WEIGHTS:
        raise _MismatchError(f"{name} takes {info.file_size:,} bytes")
    with archive.open(info) as file:
        found = npy.read_array(file, allow_pickle=False)
    if found.dtype != np.float32:
        raise _MismatchError(f"{name} is not in single precision")
    if found.shape != shape:
        raise _MismatchError(f"size mismatch: {name} has the shape {found.shape}, not {shape}")
    return found
