"""A field: obstacles, start, goal, bounds, start derivative and limits, and its JSON form."""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ferguson_gym.runtime.arrays import Array, finite, frozen, real, truncate_repr
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.runtime.json_files import read_json
from ferguson_gym.svg.notebook import ShowsPicture
from ferguson_gym.svg.picture import Picture
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.obstacles import Obstacles

START = (0.0, 0.0)
GOAL = (100.0, 100.0)
BOUNDS = (-10.0, 110.0)
_ROUNDING = 1e-4
"""Depth inside an obstacle that counts as rounding, as a fraction of the tolerance."""
_DISCS, _SHAPES = ("centers", "radii"), "obstacles"
_SHAPE = {"points", "radius"}
_OPTIONAL = ("start", "goal", "bounds", "start_derivative", "limits")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Field(ShowsPicture):
    """Obstacles, start, goal, bounds and limits of a flight; immutable.

    Raises:
        TypeError: obstacles of another class.
        ValueError: shapes that do not match, NaN or infinity, start or goal inside an
            obstacle or outside the bounds, start on the goal, lower bounds not below upper bounds,
            limits that contradict each other, a start derivative shorter or longer than that of
            any feasible segment.
    """

    name: str
    """Name in files and reports, for example `paper:1`."""
    obstacles: Obstacles
    start: Array = dataclasses.field(default_factory=lambda: np.array(START))
    """(D,) [m]."""
    goal: Array = dataclasses.field(default_factory=lambda: np.array(GOAL))
    """(D,) [m]."""
    bounds: Array = dataclasses.field(default_factory=lambda: np.array(BOUNDS))
    """Lower and upper bound: (2,) if equal for all axes, or (2, D) [m]; kept as (2, D)."""
    start_derivative: Array | None = None
    """(D,) [m per unit t]; None: towards the goal, a third of the longest segment per unit t. Kept
    as an array."""
    limits: Limits = dataclasses.field(default_factory=Limits)
    """Bounds on segments and their number, or a mapping of some of their names to values; they set
    the scale of the field. Kept as `Limits`."""

    def __post_init__(self) -> None:
        if not isinstance(self.obstacles, Obstacles):
            raise TypeError(f"obstacles are Obstacles, got {type(self.obstacles).__name__}")
        start = finite("start", self.start, (None,))
        goal = finite("goal", self.goal, (None,))
        if len(start) != len(goal):
            raise ValueError(
                "start and goal must have as many coordinates, got "
                f"{_point(start)} and {_point(goal)}"
            )
        if self.obstacles.dimension != len(start):
            raise ValueError(
                f"obstacles have {self.obstacles.dimension} dimensions, start and goal {len(start)}"
            )
        bounds = real("bounds", self.bounds)
        if bounds.shape not in ((2,), (2, len(start))):
            raise ValueError(
                "bounds must be [least, greatest] for all coordinates, or [[least of each], "
                f"[greatest of each]] with {len(start)} coordinates; got shape {bounds.shape}"
            )
        bounds = finite("bounds", bounds, bounds.shape)
        if bounds.ndim == 1:
            bounds = np.repeat(bounds[:, None], len(start), axis=1)
        if (bounds[0] >= bounds[1]).any():
            raise ValueError(f"bounds must be (least, greatest), got {bounds.tolist()}")
        way = goal - start
        distance = float(np.linalg.norm(way))
        if distance == 0.0:
            raise ValueError(f"start and goal coincide at {_point(start)}")
        limits = Limits.of(self.limits).for_distance(distance)
        derivative = (
            _default_speed(limits) * way / distance
            if self.start_derivative is None
            else finite("start_derivative", self.start_derivative, (len(start),))
        )
        if np.linalg.norm(derivative) < limits.slowest * (1.0 - 1e-12):
            raise ValueError(
                f"start_derivative must be at least {limits.slowest:g} m per unit t long, "
                f"got {_point(derivative)}"
            )
        if np.linalg.norm(derivative) > limits.steepest:
            raise ValueError(
                f"start_derivative must be at most {limits.steepest:.5g} m per unit t long, since "
                f"no segment of at most {limits.longest:g} m has a greater one, got "
                f"{_point(derivative)}, {np.linalg.norm(derivative):.5g} m per unit t long"
            )
        for label, point in (("start", start), ("goal", goal)):
            if (point < bounds[0]).any() or (point > bounds[1]).any():
                raise ValueError(
                    f"{label} {_point(point)} lies outside the bounds {bounds.tolist()}"
                )
            if len(self.obstacles):
                depth = self.obstacles.signed_distance(point)
                if depth.min() < -_ROUNDING * limits.tolerance:
                    raise ValueError(
                        f"{label} {_point(point)} lies {-depth.min():.3g} m inside "
                        f"obstacle {int(depth.argmin())}"
                    )
        object.__setattr__(self, "start", frozen(start))
        object.__setattr__(self, "goal", frozen(goal))
        object.__setattr__(self, "bounds", frozen(bounds))
        object.__setattr__(self, "start_derivative", frozen(derivative))
        object.__setattr__(self, "limits", limits)

    @property
    def departure(self) -> Array:
        """The start derivative (D,) [m per unit t], never None."""
        assert self.start_derivative is not None
        return self.start_derivative

    @property
    def distance(self) -> float:
        """Straight distance from start to goal [m]."""
        return float(np.linalg.norm(self.goal - self.start))

    def with_limits(self, **changes: float) -> Field:
        """The field with other values of some limits.

        Another `longest` scales the lengths that are not among the changes, and with them a
        default start derivative. A default number of segments stays the default.

        Raises:
            ValueError: an unknown limit, limits that contradict each other, or as `Field`.

        Example:
            >>> from ferguson_gym.world.field_names import get_field
            >>> get_field("paper:1").with_limits(longest=30).limits.shortest
            6.0
        """
        if not changes:
            return self
        limits = self.limits.changed(self.distance, changes)
        way = self.goal - self.start
        usual = np.array_equal(self.departure, _default_speed(self.limits) * way / self.distance)
        departure = None if usual else self.departure
        return dataclasses.replace(self, limits=limits, start_derivative=departure)

    def inflated(self, metres: float) -> Field:
        """The field with all obstacles grown by a vehicle's radius [m]; its name stays the same.

        Bounds stay as they are: they hold for the vehicle's centre.

        Raises:
            ValueError: metres that are negative or not finite, or so many that an obstacle contains
                the start or the goal.
        """
        if not 0.0 <= metres < np.inf:
            raise ValueError(f"obstacles are inflated by 0 m or more, got {metres:g} m")
        if metres == 0.0 or len(self.obstacles) == 0:
            return self
        grown = self.obstacles.grown(np.full(len(self.obstacles), float(metres)))
        try:
            return dataclasses.replace(self, obstacles=grown)
        except ValueError as error:
            raise ValueError(
                f"{self.name}, with obstacles inflated by {metres:g} m: {error}"
            ) from None

    def plot(self, axes: Any = None) -> Any:
        """Draw obstacles, start, goal and bounds on matplotlib axes.

        Args:
            axes: where they are drawn; None: pyplot's current axes.

        Returns:
            The axes.

        Raises:
            ValueError: a field that is not planar.
        """
        # by name: the world knows no matplotlib, which is loaded when something is drawn
        return import_module("ferguson_gym.rendering").plot_field(self, axes)

    def picture(self) -> Picture:
        """A picture of the obstacles, start, goal and bounds.

        Raises:
            ValueError: a field that is not planar.
        """
        if len(self.start) != 2:
            raise ValueError(
                f"pictures are planar, field {self.name} has {len(self.start)} dimensions"
            )
        number = len(self.obstacles)
        caption = f"{self.name}: {number} obstacle{'s' * (number != 1)}"
        picture = Picture(self.bounds[0], self.bounds[1], caption)
        picture.add_obstacles(map(self.obstacles.core, range(number)), self.obstacles.radii)
        picture.add_ends(self.start, self.goal)
        return picture


def _default_speed(limits: Limits) -> float:
    """Length of the default start derivative [m per unit t]."""
    return max(limits.longest / 3.0, limits.slowest)


def _point(point: ArrayLike) -> str:
    return "(" + ", ".join(f"{value:g}" for value in np.asarray(point)) + ")"


def from_json(path: str | os.PathLike[str]) -> Field:
    """Read a field from a JSON file; the file's stem is its name.

    Keys: discs as `centers` (n, D) and `radii` (n,), other obstacles as `obstacles`, a list of
    objects with `points` (m, D), whose convex hull is meant, and `radius` (0 if left out); optional
    `start`, `goal`, `bounds`, `start_derivative`, `limits` (some or all attributes of `Limits`).
    Other keys are ignored with a warning.

    Raises:
        ValueError: not JSON, keys missing, or values that `Field` refuses; the message
            names the file.
        OSError: the file cannot be read.
    """
    path = Path(path)
    try:
        data = read_json(path)
        if not isinstance(data, dict):
            raise ValueError("a field is a JSON object with centers and radii, or obstacles")
        options = {key: data[key] for key in _OPTIONAL if data.get(key) is not None}
        dimension = int(np.size(options.get("start", START)))
        field = Field(name=path.stem, obstacles=_obstacles_in(data, dimension), **options)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    if unknown := sorted(set(data) - {*_DISCS, _SHAPES, *_OPTIONAL}):
        warnings.warn(f"{path}: ignored unknown keys {', '.join(map(repr, unknown))}", stacklevel=2)
    return field


def _obstacles_in(data: dict[str, Any], dimension: int) -> Obstacles:
    """The obstacles of a field's JSON object; without any, in the dimension of the start."""
    parts, shapes = list[Obstacles](), data.get(_SHAPES, [])
    if not isinstance(shapes, list):
        raise ValueError(f"obstacles must be a list of objects, got {truncate_repr(shapes)}")
    if _SHAPES not in data and (missing := [key for key in _DISCS if key not in data]):
        raise ValueError(f"a field needs {' and '.join(missing)}, or obstacles")
    if data.get("centers") or data.get("radii"):
        parts.append(Obstacles.discs(data.get("centers", []), data.get("radii", [])))
    for k, shape in enumerate(shapes):
        if not isinstance(shape, dict) or "points" not in shape or set(shape) - _SHAPE:
            raise ValueError(
                f"obstacle {k} must be an object with points and radius, got {truncate_repr(shape)}"
            )
    if shapes:
        cores = [shape["points"] for shape in shapes]
        parts.append(Obstacles.hulls(cores, [shape.get("radius", 0.0) for shape in shapes]))
    return Obstacles.joined(parts) if parts else Obstacles.discs(np.empty((0, dimension)), [])


def to_json(field: Field, path: str | os.PathLike[str]) -> None:
    """Write a field as JSON; reading it again gives the same numbers, bit for bit.

    Where all obstacles are discs they are `centers` and `radii`; otherwise all are `obstacles`.
    """
    obstacles, shapes = field.obstacles, dict[str, Any]()
    if obstacles.are_discs:
        shapes = {"centers": obstacles.centers.tolist(), "radii": obstacles.radii.tolist()}
    else:
        shapes[_SHAPES] = [
            {"points": obstacles.core(k).tolist(), "radius": float(obstacles.radii[k])}
            for k in range(len(obstacles))
        ]
    data = {
        **shapes,
        "start": field.start.tolist(),
        "goal": field.goal.tolist(),
        "bounds": field.bounds.tolist(),
        "start_derivative": field.departure.tolist(),
    }
    if field.limits != Limits().for_distance(field.distance):
        data["limits"] = dataclasses.asdict(field.limits)
    with atomic_write(path) as temporary:
        temporary.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def planar_obstacles(field: Field) -> Obstacles:
    """The obstacles of a field, if it is planar, as environments need.

    Raises:
        ValueError: a field that is not planar.
    """
    dimension = field.obstacles.dimension
    if dimension != 2:
        raise ValueError(f"flights are planar, field {field.name} has {dimension} dimensions")
    return field.obstacles
