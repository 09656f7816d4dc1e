"""A path: Ferguson segments that join with equal derivatives, checked, saved and loaded."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ferguson_gym.curves import sampling, splines
from ferguson_gym.curves.arc_length import length
from ferguson_gym.runtime.arrays import Array, frozen
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.runtime.json_files import read_json
from ferguson_gym.svg.motion import Timeline
from ferguson_gym.svg.notebook import ShowsPicture
from ferguson_gym.svg.picture import Picture

_JOINT = 1e-9
"""Largest mismatch at a joint, relative to the largest entry of the control array."""

_MARGIN, _SLENDER = 0.05, 0.25
"""Margin around a path in its picture and least height of that, as parts of the longer side."""


@dataclass(frozen=True, slots=True, eq=False)
class Path(ShowsPicture):
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

    def sample(
        self, *, spacing: float | None = None, number: int | None = None
    ) -> sampling.PathSamples:
        """Points at even distances along the path, both of its ends included.

        Args:
            spacing: upper limit of the arc length between neighbours [m].
            number: number of points, at least 2; give either this or `spacing`.

        Returns:
            Arrays of distance along the path, position, direction or heading, and curvature.

        Raises:
            ValueError: both arguments or neither, a spacing that is not positive and finite, fewer
                than 2 or more than `sampling.MOST` points, or a path of length zero.

        Example:
            >>> line = Path([[[0, 0], [9, 0], [9, 0], [9, 0]]])
            >>> line.sample(spacing=3.0).position.round(9).tolist()
            [[0.0, 0.0], [3.0, 0.0], [6.0, 0.0], [9.0, 0.0]]
        """
        if (spacing is None) == (number is None):
            raise ValueError("give either spacing in metres or number of points")
        if number is not None:
            return sampling.sample(self.control, number)
        assert spacing is not None
        if not 0.0 < spacing < math.inf:
            raise ValueError(f"spacing must be above 0 m and finite, got {spacing}")
        # rounding of the length adds no point
        steps = self.length * (1.0 - _JOINT) / spacing
        if not steps <= sampling.MOST - 1:
            raise ValueError(
                f"a spacing of {spacing:g} m gives more than {sampling.MOST} points on a path of "
                f"{self.length:g} m"
            )
        return sampling.sample(self.control, max(2, math.ceil(steps) + 1))

    def plot(self, axes: Any = None) -> Any:
        """Draw the path on matplotlib axes.

        Args:
            axes: where it is drawn; None: pyplot's current axes.

        Returns:
            The axes.

        Raises:
            ValueError: a path that is not planar.
        """
        # by name: the curves know no matplotlib, which is loaded when something is drawn
        return import_module("ferguson_gym.rendering").plot_path(self, axes)

    def picture(self) -> Picture:
        """A picture of the path alone.

        Raises:
            ValueError: a path that is not planar.
        """
        picture = self.region()
        picture.add_chain(self.control)
        return picture

    def animate(self, seconds: float = 5.0) -> Picture:
        """An animated picture of a vehicle that flies the path in some seconds.

        Raises:
            ValueError: a path that is not planar, or no positive and finite number of seconds.
        """
        picture = self.region()
        picture.add_motion(self.control, Timeline(length(self.control), seconds))
        return picture

    def region(self) -> Picture:
        """A picture of the path's surroundings, without the path.

        Raises:
            ValueError: a path that is not planar.
        """
        if self.control.shape[-1] != 2:
            raise ValueError(
                f"pictures are planar, the path has {self.control.shape[-1]} dimensions"
            )
        low, high = splines.extent(self.control)
        low, high = low.min(axis=0), high.max(axis=0)
        middle, longest = (low + high) / 2.0, float((high - low).max()) or 1.0
        half = np.maximum((high - low) / 2.0 + _MARGIN * longest, _SLENDER * longest / 2.0)
        caption = f"{len(self)} segment{'s' * (len(self) != 1)}, {self.length:.4g} m"
        return Picture(middle - half, middle + half, caption)

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
            data = read_json(FilePath(path))
            if not isinstance(data, dict) or "control" not in data:
                raise ValueError("a path is a JSON object with control, (n, 4, D) numbers")
            return cls(data["control"])
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
