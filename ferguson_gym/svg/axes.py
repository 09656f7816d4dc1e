"""The frame of a picture: its caption, and numbers along the axes."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.svg.colours import OBSTACLE_EDGE
from ferguson_gym.svg.path_data import whole

PIXELS = 440
"""Pixels along the longer side of the region."""
PIXEL = 20
"""Units of a pixel; coordinates in the picture are whole units."""
UNITS = PIXELS * PIXEL
"""Units along the longer side of the region."""
_LEFT, _TOP, _RIGHT, _BOTTOM = 30, 24, 8, 20
"""Pixels around the region, for the numbers and the caption."""
_LETTER = 6.6
"""Upper limit of the mean width of a caption's letter [px]."""
_TICKS = 7
"""Upper limit of the number of ticks along the longer side."""


def framed(low: Array, high: Array, caption: str, shapes: str) -> str:
    """A picture of the region between two corners (2,) [m], as text.

    Args:
        low: (2,) least coordinates [m].
        high: (2,) greatest coordinates [m].
        caption: Escaped text above the region.
        shapes: Elements in units from the region's upper left corner; they are clipped by it.
    """
    scale = UNITS / float((high - low).max())
    wide, tall = whole(np.maximum(scale * (high - low), 1.0))
    full = max(wide + (_LEFT + _RIGHT) * PIXEL, int((_LETTER * len(caption) + _LEFT) * PIXEL))
    height = tall + (_TOP + _BOTTOM) * PIXEL
    box = f"{-_LEFT * PIXEL} {-_TOP * PIXEL} {full} {height}"
    size = f'width="{full // PIXEL}" height="{height // PIXEL}" viewBox="{box}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" font-family="sans-serif">'
        f"<title>{caption}</title>"
        f'<rect x="{-_LEFT * PIXEL}" y="{-_TOP * PIXEL}" width="{full}" height="{height}" '
        f'fill="white"/>'
        f'<svg width="{wide}" height="{tall}">{shapes}</svg>'
        f'<rect width="{wide}" height="{tall}" fill="none" stroke="{OBSTACLE_EDGE}" '
        f'stroke-width="{PIXEL}"/>'
        f'<g font-size="{9 * PIXEL}" fill="#444444">{_numbers(low, high, scale)}</g>'
        f'<text x="0" y="{-8 * PIXEL}" font-size="{11 * PIXEL}">{caption}</text></svg>'
    )


def _numbers(low: Array, high: Array, scale: float) -> str:
    """Ticks and their numbers along the lower and the left side."""
    step = _step(float((high - low).max()))
    bottom = round(scale * float(high[1] - low[1]))
    parts, lines = [], ""
    for value in _multiples(step, float(low[0]), float(high[0])):
        x = round(scale * (value - float(low[0])))
        lines += f"M{x} {bottom}v{3 * PIXEL}"
        parts.append(f'<text x="{x}" y="{bottom + 14 * PIXEL}">{value:g}</text>')
    across = f'<g text-anchor="middle">{"".join(parts)}</g>'
    parts = []
    for value in _multiples(step, float(low[1]), float(high[1])):
        y = round(scale * (float(high[1]) - value))
        lines += f"M0 {y}h{-3 * PIXEL}"
        parts.append(f'<text x="{-5 * PIXEL}" y="{y + 3 * PIXEL}">{value:g}</text>')
    upwards = f'<g text-anchor="end">{"".join(parts)}</g>'
    ticks = f'<path d="{lines}" fill="none" stroke="{OBSTACLE_EDGE}" stroke-width="{PIXEL}"/>'
    return ticks + across + upwards


def _step(extent: float) -> float:
    """The least of 1, 2 and 5 times a power of ten that makes at most `_TICKS` steps."""
    power = 10.0 ** np.floor(np.log10(extent / _TICKS))
    return float(next(k * power for k in (1, 2, 5, 10) if extent <= _TICKS * k * power))


def _multiples(step: float, low: float, high: float) -> list[float]:
    """Multiples of a step between two numbers, without rounding noise."""
    first, last = int(np.ceil(low / step)), int(np.floor(high / step))
    return [round(k * step, 12) for k in range(first, last + 1)]
