"""Writes frames as a GIF with one palette, in which large areas keep their exact colours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import cKDTree

from ferguson_gym.runtime.atomic_files import atomic_write

SUFFIX = ".gif"
COLOURS = 254
"""Colours of the palette; a GIF has 256, one of which marks unchanged pixels."""

Pixels: TypeAlias = NDArray[np.uint8]
"""RGB values (height, width, 3) of a frame."""


class Palette:
    """A palette made from some frames; the colours of others are replaced by the nearest."""

    def __init__(self, frames: Sequence[Pixels]) -> None:
        sheet = np.concatenate(frames)
        kinds, often = np.unique(_packed(sheet), return_counts=True)
        common = _unpacked(kinds[np.argsort(-often, kind="stable")[: COLOURS // 2]])
        # the other half covers the remaining colours, including strong ones of small areas
        covering = Image.fromarray(sheet).quantize(
            COLOURS // 2, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
        )
        rest = np.array(covering.getpalette()).reshape(-1, 3)
        self._colours = np.concatenate([common, rest])
        self._nearest = cKDTree(self._colours)
        # Pillow's own search for the nearest colour is coarse and would merge pale bands
        self._index = np.full(1 << 24, -1, np.int16)

    def __call__(self, frame: Pixels) -> Image.Image:
        """A frame in the colours of the palette."""
        packed = _packed(frame)
        new = np.unique(packed[self._index[packed] < 0])
        if len(new):
            self._index[new] = self._nearest.query(_unpacked(new))[1]
        image = Image.fromarray(self._index[packed].astype(np.uint8))
        image.putpalette(self._colours.ravel().tolist())
        return image


def _packed(frame: Pixels) -> NDArray[np.int32]:
    """Colours as single numbers, 8 bits for each of red, green and blue."""
    wide = frame.astype(np.int32)
    packed: NDArray[np.int32] = wide[..., 0] << 16 | wide[..., 1] << 8 | wide[..., 2]
    return packed


def _unpacked(packed: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=-1)


def write_gif(
    path: Path, frames: Iterable[Pixels], seconds: Sequence[float], palette: Palette
) -> None:
    """Write frames as a GIF that repeats; each is shown for its seconds.

    Frames are consumed one by one. If an error interrupts them, the file is not changed.
    """
    images = map(palette, frames)
    with atomic_write(path) as temporary, temporary.open("wb") as file:
        next(images).save(
            file,
            format="GIF",
            save_all=True,
            append_images=images,
            duration=[round(1000.0 * shown) for shown in seconds],
            loop=0,
            optimize=True,  # unchanged areas are not stored again
        )
