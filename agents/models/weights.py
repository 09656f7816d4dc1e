"""Weights of a model in its `model.zip`: an entry in NumPy's format for each, nothing pickled.

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

from agents.models.inference.activations import Single

Weights: TypeAlias = Mapping[str, Single]
"""By their names in torch."""
Shapes: TypeAlias = Mapping[str, tuple[int, ...]]

MOST = 64_000_000
"""Limit on the number of weights: a small file can unpack to any number."""
_FOLDER, _SUFFIX = "weights/", ".npy"


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
    except Exception:  # the libraries raise errors of many types on a damaged file
        raise ValueError(f"{path}: not a zip file, or damaged") from None


def read(path: Path, shapes: Shapes) -> dict[str, Single]:
    """Read the weights of these names and shapes from a zip.

    Raises:
        ValueError: An array is missing, has another shape or type or is not finite; there are too
            many weights; the file is not a zip file or is damaged.
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
    if info.file_size > 4 * MOST:
        raise _UnfitError(f"{name} takes {info.file_size:,} bytes")
    with archive.open(info) as file:
        found = npy.read_array(file, allow_pickle=False)
    if found.dtype != np.float32:
        raise _UnfitError(f"{name} is not in single precision")
    if found.shape != shape:
        raise _UnfitError(f"size mismatch: {name} has the shape {found.shape}, not {shape}")
    return found
