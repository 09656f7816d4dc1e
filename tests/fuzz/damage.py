"""Damage to a file: other bytes, other cells of a table, other arrays, or no file at all."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from tests.fuzz.strategies import JSON, damaged, twisted


class Damage:
    """Puts other bytes in a file's place, and the right ones back."""

    def __init__(self, file: Path, data: Any) -> None:
        whole = file.read_bytes()
        kinds = [damaged(whole)]
        if file.suffix == ".json":
            kinds += [twisted(whole), JSON.map(lambda value: json.dumps(value).encode())]
        if file.suffix == ".csv":
            kinds += [cells(whole), cells(whole)]
        if file.suffix == ".npz":
            kinds += [arrays_changed(whole, file), arrays_changed(whole, file)]
        self._file, self._whole = file, whole
        self._new: bytes | None = data.draw(st.one_of(st.none(), *kinds))

    def __enter__(self) -> None:
        if self._new is None:
            self._file.unlink()
        else:
            self._file.write_bytes(self._new)

    def __exit__(self, *_: object) -> None:
        self._file.write_bytes(self._whole)


CELLS = st.sampled_from(
    ["", "nan", "inf", "-1", "1e999", "x", '"', "0", "guided", "9" * 400, "1.5"]
)


@st.composite
def cells(draw: st.DrawFn, data: bytes) -> bytes:
    """A table with other cells, rows twice, or rows left out."""
    rows = [line.split(",") for line in data.decode().splitlines()]
    for _ in range(draw(st.integers(1, 3))):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = draw(CELLS)
    if draw(st.booleans()):
        rows.append(draw(st.sampled_from(rows)))
    if draw(st.booleans()):
        del rows[draw(st.integers(0, len(rows) - 1))]
    return "\n".join(",".join(row) for row in rows).encode()


@st.composite
def arrays_changed(draw: st.DrawFn, data: bytes, file: Path) -> bytes:
    """Arrays of other shapes, kinds or values; pickled ones among them."""
    with np.load(file, allow_pickle=False) as whole:
        arrays = {key: whole[key] for key in whole}
    for _ in range(draw(st.integers(1, 2))):
        key = draw(st.sampled_from(sorted(arrays)))
        kind = draw(st.integers(0, 6))
        array = arrays[key]
        if kind == 0:
            del arrays[key]
            if not arrays:
                break
        elif kind == 1:
            arrays[key] = array[:-1] if array.ndim else np.zeros(3)
        elif kind == 2:
            arrays[key] = np.array([{"a": 1}, None], object)
        elif kind == 3:
            arrays[key] = np.full(array.shape, "text")
        elif kind == 4 and array.dtype.kind in "iufb":
            value = draw(st.sampled_from([-1, 3, 120, 2**40, math.nan, math.inf]))
            with np.errstate(all="ignore"):
                arrays[key] = np.full(array.shape, value).astype(array.dtype)
        elif kind == 5:
            arrays[key] = array[None]
        else:
            arrays[key] = np.concatenate([array, array]) if array.ndim else array[None]
    place = file.with_name("changed.npz")
    np.savez(place, **arrays)  # type: ignore[arg-type]
    changed = place.read_bytes()
    place.unlink()
    return changed
