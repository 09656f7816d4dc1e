"""Obstacles: convex cores grown by radii. Discs, the obstacles of the paper, have cores of a point.

Shapes that are not convex are several obstacles that overlap.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.clearance import closest, obstacle_clearance
from ferguson_gym.curves.convex_core import Cores
from ferguson_gym.curves.splines import as_control, to_bezier
from ferguson_gym.runtime.arrays import Array, GenericArray, finite, frozen, real
from ferguson_gym.world.cores import distance as core_distance
from ferguson_gym.world.cores.hulls import hulls, warn_of_hulls

MANY = 1000
"""Among more obstacles than these, those near a point or segment are looked up by coordinates."""
_WIDER = 1.0 + 1e-12
"""Factor by which a bounding ball is larger than its obstacle, for rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """Obstacles at rest, each the convex hull of its core's corners, grown by a radius.

    Make them by `discs`, `capsules`, `polygons`, `boxes`, `hulls` or `joined`, which check the
    geometry; they may overlap. Obstacles of D = 2 dimensions can have any core, others have cores
    of one or two points.

    Raises:
        ValueError: mismatched shapes, NaN or infinity, or an obstacle without an inside: a negative
            radius, or a radius of zero around a core that is no polygon.
    """

    points: Array
    """Corners of all cores (c, D) [m], core after core; polygons counter-clockwise."""
    radii: Array
    """Radii (n,) by which the cores are grown [m]."""
    first: NDArray[np.int64] | None = None
    """(n + 1,) index of the first corner of each core, the last entry is c; None: one corner each.
    Kept as an array."""
    _balls: tuple[Array, Array] | None = dataclasses.field(init=False, repr=False, default=None)
    """Centres (n, D) and radii (n,) of balls that contain the obstacles."""
    _sorted: tuple[NDArray[np.int64], Array, float] | None = dataclasses.field(
        init=False, repr=False, default=None
    )
    """Obstacles in the order of their balls' first coordinate, those coordinates, and the largest
    radius of a ball; made when they are needed first."""

    def __post_init__(self) -> None:
        points = real("centers" if self.first is None else "points", self.points)
        if points.shape == (0,):
            points = np.empty((0, 2))
        points = finite("centers" if self.first is None else "points", points, (None, None))
        radii = finite("radii", self.radii, (None,))
        first = np.arange(len(points) + 1) if self.first is None else self.first
        first = np.array(first, dtype=np.int64)
        if len(first) != len(radii) + 1:
            raise ValueError(
                f"every disc needs a centre and a radius, got {len(points)} centers "
                f"and {len(radii)} radii"
                if self.first is None
                else f"every core needs a radius, got {len(first) - 1} cores and {len(radii)} radii"
            )
        number = np.diff(first)
        if first[0] != 0 or first[-1] != len(points) or (number < 1).any():
            raise ValueError(f"first must rise from 0 to {len(points)}, got {first.tolist()}")
        flat = number < 3
        if len(radii) and radii[flat].min(initial=np.inf) <= 0.0:
            wrong = int(np.flatnonzero(flat & (radii <= 0.0))[0])
            shape = (
                "" if self.first is None else f" around a core without an area, obstacle {wrong}"
            )
            raise ValueError(f"radii must be positive, got {radii[wrong]:g} m{shape}")
        if len(radii) and radii.min() < 0.0:
            raise ValueError(f"radii must not be negative, got {radii.min():g} m")
        if not flat.all() and points.shape[1] != 2:
            raise ValueError(f"polygons are planar, got points in {points.shape[1]} dimensions")
        first.flags.writeable = False
        for name, value in (("points", frozen(points)), ("radii", frozen(radii)), ("first", first)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_balls", self._bounding_balls())

    def _bounding_balls(self) -> tuple[Array, Array]:
        if self.are_discs:
            return self.points, self.radii
        starts, number = self.starts[:-1], np.diff(self.starts)
        low = np.minimum.reduceat(self.points, starts, axis=0)
        high = np.maximum.reduceat(self.points, starts, axis=0)
        middle = np.where(number[:, None] == 1, self.points[starts], 0.5 * (low + high))
        away = np.linalg.norm(self.points - np.repeat(middle, number, axis=0), axis=1)
        around = np.maximum.reduceat(away, starts)
        radii = np.where(number == 1, self.radii, (around + self.radii) * _WIDER)
        return frozen(middle), frozen(radii)

    @staticmethod
    def discs(centers: ArrayLike, radii: ArrayLike) -> Obstacles:
        """Discs in the plane, balls in D dimensions.

        Args:
            centers: (n, D) [m].
            radii: (n,) [m], positive.

        Raises:
            ValueError: as the class.
        """
        return Obstacles(centers, radii)  # type: ignore[arg-type]

    @staticmethod
    def capsules(ends: ArrayLike, radii: ArrayLike) -> Obstacles:
        """Capsules: all points within a radius of a line.

        Args:
            ends: (n, 2, D) both ends of each line [m].
            radii: (n,) or one for all [m], positive.

        Raises:
            ValueError: as the class.
        """
        ends = finite("ends", ends, (None, 2, None))
        differ = ends[:, 0] != ends[:, 1]
        if not differ.any(axis=1).all():
            return Obstacles.hulls(ends, radii)  # type: ignore[arg-type]
        # both ends in the order in which a hull has them, all at once
        which, axis = np.arange(len(ends)), differ.argmax(axis=1)
        swapped = ends[which, 0, axis] > ends[which, 1, axis]
        return _of_corners(np.where(swapped[:, None, None], ends[:, ::-1], ends), radii)

    @staticmethod
    def polygons(polygons: Sequence[ArrayLike], radii: ArrayLike = 0.0) -> Obstacles:
        """Convex polygons in the plane, with rounded corners where they have a radius.

        Args:
            polygons: (m, 2) corners of each, in any order [m].
            radii: (n,) or one for all [m], by which the polygons are grown.

        Raises:
            ValueError: as the class, or a polygon without an area.
        """
        made = Obstacles.hulls(polygons, radii)
        if (flat := np.diff(made.starts) < 3).any():
            raise ValueError(f"polygon {int(flat.argmax())} has no area; `capsules` are lines")
        return made

    @staticmethod
    def boxes(low: ArrayLike, high: ArrayLike, radii: ArrayLike = 0.0) -> Obstacles:
        """Rectangles with sides along the axes of the plane.

        Args:
            low: (n, 2) lower corners [m].
            high: (n, 2) upper corners [m].
            radii: (n,) or one for all [m], by which the rectangles are grown.

        Raises:
            ValueError: as the class, or an upper corner that is not above the lower one.
        """
        low, high = finite("low", low, (None, 2)), finite("high", high, (None, 2))
        if low.shape != high.shape or not (low < high).all():
            raise ValueError("every box needs a lower corner, and an upper one above it")
        corners = np.stack([low, low, high, high], axis=1)
        corners[:, 1, 0], corners[:, 3, 0] = high[:, 0], low[:, 0]
        return _of_corners(corners, radii)

    @staticmethod
    def hulls(cores: Sequence[ArrayLike], radii: ArrayLike) -> Obstacles:
        """Convex hulls of points, grown by radii: obstacles of every shape.

        Points that are not in convex position give a warning.

        Args:
            cores: (m, D) points of each [m], any number m from 1 on.
            radii: (n,) or one for all [m].

        Raises:
            ValueError: as the class, or a core without points.
        """
        corners, changed = hulls(cores)
        warn_of_hulls(changed)
        return _of_corners(corners, radii)

    @staticmethod
    def joined(parts: Iterable[Obstacles]) -> Obstacles:
        """Several sets of obstacles as one, in their order.

        Raises:
            ValueError: obstacles of different dimensions.
        """
        every = [part for part in parts if len(part)]
        if not every:
            return Obstacles(np.empty((0, 2)), np.empty(0))
        if len(dimensions := sorted({part.dimension for part in every})) > 1:
            raise ValueError(
                "obstacles must all have the same dimension, got some of "
                f"{dimensions[0]} and some of {dimensions[-1]} dimensions"
            )
        ends = np.cumsum([0, *(len(part.points) for part in every)])
        starts = [part.starts[:-1] + end for part, end in zip(every, ends, strict=False)]
        return Obstacles(
            np.concatenate([part.points for part in every]),
            np.concatenate([part.radii for part in every]),
            np.concatenate([*starts, ends[-1:]]),
        )

    @property
    def dimension(self) -> int:
        """Dimension D of the space."""
        return int(self.points.shape[1])

    def __len__(self) -> int:
        return len(self.radii)

    @property
    def starts(self) -> NDArray[np.int64]:
        """`first`, never None."""
        assert self.first is not None
        return self.first

    @property
    def are_discs(self) -> bool:
        """Whether every core is a point."""
        return len(self.points) == len(self.radii)

    @property
    def centers(self) -> Array:
        """Centres of discs (n, D) [m].

        Raises:
            TypeError: other obstacles.
        """
        if not self.are_discs:
            raise TypeError("only discs have centers; see `points` and `first` for other obstacles")
        return self.points

    @property
    def balls(self) -> tuple[Array, Array]:
        """Centres (n, D) and radii (n,) [m] of balls that contain obstacles; discs are these."""
        assert self._balls is not None
        return self._balls

    @property
    def cores(self) -> Cores:
        """The cores for compiled functions, of one type for discs and others: compiled once."""
        if self.are_discs:
            return Cores(np.empty((self.dimension, 0)), np.empty(0, np.int64), np.empty(0))
        return Cores(np.array(self.points.T, order="C"), self.starts.copy(), self.radii.copy())

    def core(self, k: int) -> Array:
        """Corners (m, D) of the core of obstacle k [m]."""
        return self.points[self.starts[k] : self.starts[k + 1]]

    def signed_distance(self, points: GenericArray) -> GenericArray:
        """Distance of points (*batch, D) to each obstacle: (*batch, n) [m], negative inside.

        Complex points give complex distances, so that the complex-step method works.
        """
        if self.are_discs:
            offset = points[..., None, :] - self.points
            distance: GenericArray = np.sqrt(np.sum(offset * offset, axis=-1)) - self.radii
            return distance
        return core_distance.signed_distance(points, self.cores)

    def are_free(self, points: Array) -> NDArray[np.bool_]:
        """Whether all points of each set (*batch, k, D) are outside all obstacles: (*batch,)."""
        flat = np.ascontiguousarray(points.reshape(-1, *points.shape[-2:]))
        free = core_distance.are_free(flat, *self.balls, self.cores, tuple(range(self.dimension)))
        return free.reshape(points.shape[:-2])

    def gradient(self, points: Array) -> Array:
        """Gradient of `signed_distance` with respect to the point: (*batch, n, D).

        Unit vectors away from the nearest point of each core; zero on a disc's centre.
        """
        if not self.are_discs:
            return core_distance.gradient(points, self.cores)
        offset = points[..., None, :] - self.points
        distance = np.sqrt(np.sum(offset * offset, axis=-1, keepdims=True))
        unit: Array = np.divide(offset, distance, out=np.zeros_like(offset), where=distance > 0.0)
        return unit

    def near(self, point: ArrayLike, reach: float) -> Obstacles:
        """The obstacles with a signed distance of at most `reach` [m] from a point (D,)."""
        return self.only_these(self.which_near(point, reach))

    def which_near(self, point: ArrayLike, reach: float) -> NDArray[np.int64]:
        """The indices (m,), rising, of the obstacles that `near` selects."""
        point = np.asarray(point, dtype=np.float64)
        if len(self) <= MANY:
            return np.flatnonzero(self.signed_distance(point) <= reach)
        near = self._slab(point, reach)
        return near[self.only_these(near).signed_distance(point) <= reach]

    def _slab(self, point: Array, reach: float) -> NDArray[np.int64]:
        """The obstacles near a point (D,) by their first coordinate alone, in their order."""
        centers, radii = self.balls
        if self._sorted is None:
            order = np.argsort(centers[:, 0], kind="stable")
            found = order, centers[order, 0], float(radii.max())
            object.__setattr__(self, "_sorted", found)
        assert self._sorted is not None
        order, along, largest = self._sorted
        # wider than necessary, for rounding
        room = (reach + largest) * (1.0 + 1e-9) + 1e-12 * abs(point[0])
        first = np.searchsorted(along, point[0] - room)
        end = np.searchsorted(along, point[0] + room, side="right")
        return np.sort(order[first:end])

    def only(self, keep: NDArray[np.bool_]) -> Obstacles:
        """The obstacles that a mask (n,) selects."""
        return self.only_these(np.flatnonzero(keep))

    def only_these(self, which: NDArray[np.int64]) -> Obstacles:
        """The obstacles with these indices (m,), in this order."""
        if self.are_discs:
            return Obstacles(self.points[which], self.radii[which])
        number = np.diff(self.starts)[which]
        first = np.concatenate([[0], np.cumsum(number)])
        corners = np.arange(first[-1]) + np.repeat(self.starts[which] - first[:-1], number)
        return Obstacles(self.points[corners], self.radii[which], first)

    def grown(self, by: Array) -> Obstacles:
        """The obstacles with surfaces moved outwards by distances (n,) [m], 0 or more."""
        return dataclasses.replace(self, radii=self.radii + by)

    def rescaled(self, origin: Array, scale: float) -> Obstacles:
        """The obstacles moved so that a point (D,) [m] is the origin, and then scaled."""
        points = scale * (self.points - origin)
        return dataclasses.replace(self, points=points, radii=scale * self.radii)

    def clearance(self, control: ArrayLike) -> Array:
        """Certified least signed distance along whole segments: (*batch,) [m]."""
        if len(self) <= MANY:
            return obstacle_clearance(control, *self.balls, self.cores)
        control = as_control(control)
        if control.shape[-1] != self.dimension or control.size == 0:
            return obstacle_clearance(control, *self.balls, self.cores)
        points = to_bezier(control).reshape(-1, self.dimension)
        # the curves lie in this ball around the middle of their Bézier points
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = (1.0 + 1e-9) * float(np.linalg.norm(points - middle, axis=1).max())
        room = max(reach, 1e-9)
        while True:
            near = self.near(middle, reach + room)
            least = obstacle_clearance(control, *near.balls, near.cores)
            # all other obstacles are at least this far away
            if len(near) == len(self) or (least <= room).all() or not math.isfinite(room):
                return least
            room *= 2.0

    def closest(self, control: ArrayLike) -> tuple[Array, Array]:
        """Certified clearance from each obstacle and its parameter: 2 x (*batch, n)."""
        return closest(control, *self.balls, self.cores)


def _of_corners(corners: Sequence[Array] | Array, radii: ArrayLike) -> Obstacles:
    """Obstacles from the corners (m, D) of each core, which are in order."""
    radii = real("radii", radii)
    radii = np.full(len(corners), float(radii)) if radii.ndim == 0 else radii
    number = [len(one) for one in corners]
    points = np.concatenate(list(corners)) if len(corners) else np.empty((0, 2))
    return Obstacles(points, radii, np.concatenate([[0], np.cumsum(number, dtype=np.int64)]))
