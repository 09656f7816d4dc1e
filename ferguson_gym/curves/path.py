"""A path: Ferguson segments that join with one tangent, checked, saved and loaded."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np

from ferguson_gym.curves import splines
from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array, frozen
from ferguson_gym.runtime.atomic_files import atomic_write

_JOINT = 1e-9
"""Largest gap between segments, relative to the largest entry of the control array."""


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A C1 chain of segments.

    Raises:
        ValueError: a control array of the wrong shape or not finite, or neighbours that do
            not share point and derivative.
    """

    control: Array
    """(n, 4, D): start, end [m], start derivative, end derivative [m per unit t]."""

    def __post_init__(self) -> None:
        control = splines.as_control(self.control)
        if control.ndim != 3 or len(control) == 0:
            raise ValueError(f"a path has shape (n, 4, D) with n >= 1, got {control.shape}")
        gap = np.abs(control[1:, (0, 2)] - control[:-1, (1, 3)])
        allowed = _JOINT * np.abs(control).max()
        if gap.size and gap.max() > allowed:
            joint, row = np.unravel_index(gap.max(axis=-1).argmax(), gap.shape[:2])
            what = "point" if row == 0 else "derivative"
            raise ValueError(
                f"segments {joint} and {joint + 1} do not join: their {what}s differ by "
                f"{gap.max():.3g}"
            )
        object.__setattr__(self, "control", frozen(control))

    def __len__(self) -> int:
        return len(self.control)

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(length(self.control).sum())

    @property
    def min_turn_radius(self) -> float:
        """Smallest radius of curvature [m]: infinite on a straight line, 0 at a cusp.

        A radius beyond a billion path lengths is rounding, and counts as straight.
        """
        sharpest = float(splines.max_curvature(self.control).max())
        return np.inf if sharpest * self.length <= 1e-9 else 1.0 / sharpest

    def points(self, per_segment: int = 50) -> Array:
        """Points along the path for drawing: (n * per_segment + 1, D) [m].

        Raises:
            ValueError: fewer than one point a segment.
        """
        if per_segment < 1:
            raise ValueError(f"need at least 1 point a segment, got {per_segment}")
        t = np.linspace(0.0, 1.0, per_segment + 1)
        inner = splines.evaluate(self.control, t[:-1]).reshape(-1, self.control.shape[-1])
        return np.vstack([inner, self.control[-1, 1]])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the path as JSON; loading it gives the same numbers, bit for bit."""
        with atomic_write(path) as temporary:
            temporary.write_text(json.dumps({"control": self.control.tolist()}) + "\n")

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Path:
        """Read a path that `save` wrote.

        Raises:
            ValueError: not such a file, or not a path; the message names the file.
            OSError: the file cannot be read.
        """
        try:
            data = json.loads(FilePath(path).read_text(encoding="utf-8"))
            if not isinstance(data, dict) or "control" not in data:
                raise ValueError("a path is a JSON object with control, (n, 4, D) numbers")
            return cls(data["control"])
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from None
