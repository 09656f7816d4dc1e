"""Motion along a segment in equal strides, for animations and videos."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import evaluate, subdivide
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.limits import PAPER_LIMITS

FPS = 20
"""Frames a second of a flight in motion."""
STRIDE = PAPER_LIMITS.longest / 10.0
"""Approximate distance between two frames in motion [m]."""
_T = np.linspace(0.0, 1.0, 241)


def strides(control: Array, stride: float = STRIDE) -> Array:
    """Parameters (n,) at equal distances along a segment (4, D), about a stride [m] apart.

    The first is behind the first stride, the last is 1.
    """
    chords = np.linalg.norm(np.diff(evaluate(control, _T), axis=0), axis=1)
    number = max(1, round(float(length(control)) / stride))
    distances = np.concatenate([[0.0], np.cumsum(chords)])
    t = np.interp(np.linspace(0.0, distances[-1], number + 1)[1:], distances, _T)
    t[-1] = 1.0
    return t


def parts(control: Array, stride: float = STRIDE) -> Iterator[Array]:
    """The part (4, D) of a segment that is flown after each stride; the last is the segment."""
    for t in strides(control, stride)[:-1]:
        yield subdivide(control, float(t))[0]
    yield control
