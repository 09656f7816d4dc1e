"""Obstacles by their signed distance, and discs, the obstacles of the paper."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ferguson_gym.curves.clearance import clearance, closest
from ferguson_gym.curves.splines import as_control, to_bezier
from ferguson_gym.runtime.arrays import Array, GenericArray, finite, frozen, real
from ferguson_gym.runtime.jit import compiled


class Obstacles(Protocol):
    """Interface of obstacles of any shape, for planners and the environment."""

    @property
    def dimension(self) -> int:
        """Dimension D of the space."""

    def __len__(self) -> int: ...

    def signed_distance(self, points: GenericArray) -> GenericArray:
        """Distance of points (*batch, D) to each obstacle: (*batch, n) [m], negative inside."""

    def are_free(self, points: Array) -> NDArray[np.bool_]:
        """Whether all points of each set (*batch, k, D) are outside all obstacles: (*batch,)."""

    def gradient(self, points: Array) -> Array:
        """Gradient of `signed_distance` with respect to the point: (*batch, n, D)."""

    def near(self, point: ArrayLike, reach: float) -> Obstacles:
        """The obstacles with a signed distance of at most `reach` [m] from a point."""

    def only(self, keep: NDArray[np.bool_]) -> Obstacles:
        """The obstacles that a mask (n,) selects."""

    def grown(self, by: Array) -> Obstacles:
        """The obstacles with surfaces moved outwards by distances (n,) [m], 0 or more."""

    def rescaled(self, origin: Array, scale: float) -> Obstacles:
        """The obstacles moved so that a point (D,) [m] is the origin, and then scaled."""

    def clearance(self, control: ArrayLike) -> Array:
        """Certified least signed distance along whole segments: (*batch,) [m]."""

    def closest(self, control: ArrayLike) -> tuple[Array, Array]:
        """Certified clearance from each obstacle and the parameter t there: 2 x (*batch, n)."""


MANY = 1000
"""Among more discs than these, those near a point or segment are looked up by their coordinates."""


@compiled
def _are_free(points: Array, centers: Array, radii: Array) -> NDArray[np.bool_]:
    result = np.ones(len(points), dtype=np.bool_)
    for k in range(len(points)):
        for disc in range(len(radii)):
            for i in range(points.shape[1]):
                square = 0.0
                for d in range(points.shape[2]):
                    square += (points[k, i, d] - centers[disc, d]) ** 2
                if square < radii[disc] ** 2:
                    result[k] = False
                    break
            if not result[k]:
                break
    return result


@dataclass(frozen=True, slots=True, eq=False)
class Discs:
    """Discs in the plane (balls in D dimensions); they may overlap.

    Raises:
        ValueError: mismatched shapes, NaN or infinity, radii that are not positive.
    """

    centers: Array
    """Centres (n, D) [m]."""
    radii: Array
    """Radii (n,) [m]."""
    _sorted: tuple[NDArray[np.int64], Array, float] | None = dataclasses.field(
        init=False, repr=False, default=None
    )
    """Discs in the order of their first coordinate, those coordinates, and the largest radius; made
    when they are needed first."""

    def __post_init__(self) -> None:
        centers = real("centers", self.centers)
        if centers.shape == (0,):
            centers = np.empty((0, 2))
        centers = finite("centers", centers, (None, None))
        radii = finite("radii", self.radii, (None,))
        if len(centers) != len(radii):
            raise ValueError(
                f"every disc needs a centre and a radius, got {len(centers)} centers "
                f"and {len(radii)} radii"
            )
        if len(radii) and radii.min() <= 0.0:
            raise ValueError(f"radii must be positive, got {radii.min():g} m")
        object.__setattr__(self, "centers", frozen(centers))
        object.__setattr__(self, "radii", frozen(radii))

    @property
    def dimension(self) -> int:
        """Dimension D of the space."""
        return int(self.centers.shape[1])

    def __len__(self) -> int:
        return len(self.radii)

    def signed_distance(self, points: GenericArray) -> GenericArray:
        """Distance of points (*batch, D) to each disc: (*batch, n) [m], negative inside.

        Uses x * x instead of |x|^2, so that the complex-step method works.
        """
        offset = points[..., None, :] - self.centers
        distance: GenericArray = np.sqrt(np.sum(offset * offset, axis=-1)) - self.radii
        return distance

    def are_free(self, points: Array) -> NDArray[np.bool_]:
        """Whether all points of each set (*batch, k, D) are outside all discs: (*batch,)."""
        flat = np.ascontiguousarray(points.reshape(-1, *points.shape[-2:]))
        return _are_free(flat, self.centers, self.radii).reshape(points.shape[:-2])

    def gradient(self, points: Array) -> Array:
        """Unit vectors away from the centres: (*batch, n, D); zero at a centre."""
        offset = points[..., None, :] - self.centers
        distance = np.sqrt(np.sum(offset * offset, axis=-1, keepdims=True))
        unit: Array = np.divide(offset, distance, out=np.zeros_like(offset), where=distance > 0.0)
        return unit

    def near(self, point: ArrayLike, reach: float) -> Discs:
        """The discs with a signed distance of at most `reach` [m] from a point (D,)."""
        point = np.asarray(point, dtype=np.float64)
        if len(self) <= MANY:
            return self.only(self.signed_distance(point) <= reach)
        near = self._slab(point, reach)
        apart = np.linalg.norm(self.centers[near] - point, axis=1) - self.radii[near]
        near = near[apart <= reach]
        return Discs(self.centers[near], self.radii[near])

    def _slab(self, point: Array, reach: float) -> NDArray[np.int64]:
        """The discs near a point (D,) by their first coordinate alone, in their order."""
        if self._sorted is None:
            order = np.argsort(self.centers[:, 0], kind="stable")
            found = order, self.centers[order, 0], float(self.radii.max())
            object.__setattr__(self, "_sorted", found)
        assert self._sorted is not None
        order, along, largest = self._sorted
        # wider than necessary, for rounding
        room = (reach + largest) * (1.0 + 1e-9) + 1e-12 * abs(point[0])
        first = np.searchsorted(along, point[0] - room)
        end = np.searchsorted(along, point[0] + room, side="right")
        return np.sort(order[first:end])

    def only(self, keep: NDArray[np.bool_]) -> Discs:
        """The obstacles that a mask (n,) selects."""
        return Discs(self.centers[keep], self.radii[keep])

    def grown(self, by: Array) -> Discs:
        """The discs with radii increased by distances (n,) [m], 0 or more."""
        return Discs(self.centers, self.radii + by)

    def rescaled(self, origin: Array, scale: float) -> Discs:
        """The discs moved so that a point (D,) [m] is the origin, and then scaled."""
        return Discs(scale * (self.centers - origin), scale * self.radii)

    def clearance(self, control: ArrayLike) -> Array:
        """Certified least signed distance along whole segments: (*batch,) [m]."""
        if len(self) <= MANY:
            return clearance(control, self.centers, self.radii)
        control = as_control(control)
        if control.shape[-1] != self.dimension or control.size == 0:
            return clearance(control, self.centers, self.radii)
        points = to_bezier(control).reshape(-1, self.dimension)
        # the curves lie in this ball around the middle of their Bézier points
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        reach = (1.0 + 1e-9) * float(np.linalg.norm(points - middle, axis=1).max())
        room = max(reach, 1e-9)
        while True:
            near = self.near(middle, reach + room)
            least = clearance(control, near.centers, near.radii)
            # all other discs are at least this far away
            if len(near) == len(self) or (least <= room).all() or not math.isfinite(room):
                return least
            room *= 2.0

    def closest(self, control: ArrayLike) -> tuple[Array, Array]:
        """Certified clearance from each disc and its parameter: 2 x (*batch, n)."""
        return closest(control, self.centers, self.radii)
