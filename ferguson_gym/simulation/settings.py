"""Arguments of the environments, checked in one place."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Integral, Real
from typing import Any

import numpy as np

from ferguson_gym.runtime.arrays import finite, truncate_repr
from ferguson_gym.runtime.suggestions import did_you_mean
from ferguson_gym.simulation.observations import KINDS, Layout, rays_around
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_pool import MAX_FIELDS, FieldPool
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.suites import (
    SUITES,
    Recipe,
    Scattered,
    check_suite,
    suite_obstacles,
    with_overrides,
)

MAX_OBSTACLES = 10_000
"""Upper limit of `obstacles` and `capacity`, and of `rays`, `nearest` and `segments`."""
MAX_VIEW = 1000.0
"""Upper limit of `view` [m]."""
MAX_MARGIN = 10.0
"""Upper limit of `margin` [m]."""
STRAIGHT, WAY = "straight", "way"
"""Along what rewards measure progress."""
INFOS = ("is_success", "outcome", "path_length", "clearance", "segments")
"""Keys of `info`, without the one that `reference` adds."""
OBSERVING = ("observation", "nearest", "focus", "rays", "view", "way", "margin")
"""Arguments that determine what is observed, apart from its form."""
CHANGEABLE = (
    *("suite", "split", "fields", "obstacles", "radii"),
    *("gate", "segments", "detour", "failure"),
)
"""Arguments that may change between flights: all but those that shape what is returned."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Arguments of the environment `ferguson/ObstacleField-v0`; its docstring explains them.

    Raises:
        ValueError: an argument of the wrong type or out of range; the message gives the range.
    """

    suite: str = "standard"
    split: str = "train"
    fields: Any = 10_000  # a number, or a pool, which is made of anything that names fields
    obstacles: int | None = None
    radii: Sequence[float] | None = None
    gate: float | None = None
    segments: int | None = None
    observation: str = "rays"
    nearest: int = 12
    focus: float = 0.0
    rays: int = 64
    view: float = 30.0
    way: int = 0
    margin: float = 0.8
    flat: bool = False
    progress: str = "straight"
    reference: bool = False
    detour: float = 4.0
    failure: float = 2.0
    capacity: int | None = None

    def __post_init__(self) -> None:
        for name in ("suite", "split", "observation", "progress"):
            if not isinstance(given := getattr(self, name), str):
                raise ValueError(f"{name} must be a name, got {truncate_repr(given)}")
        check_suite(self.suite, self.split)
        self._check_numbers()
        self._check_fields()
        for name in ("flat", "reference"):
            if type(given := getattr(self, name)) is not bool:
                raise ValueError(f"{name} is True or False, got {truncate_repr(given)}")
        if self.progress not in (STRAIGHT, WAY):
            raise ValueError(
                f"progress is measured {STRAIGHT} or along the {WAY}, got {self.progress!r}"
            )
        for name in ("obstacles", "capacity"):
            number = getattr(self, name)
            if number is not None and not 0 <= number <= MAX_OBSTACLES:
                raise ValueError(f"a field has 0 to {MAX_OBSTACLES} obstacles, got {name}={number}")
        if self.observation not in KINDS:
            raise ValueError(
                f"unknown observation {self.observation!r}; kinds are {', '.join(KINDS)}"
            )
        for name in ("nearest", "rays", "segments"):
            number = getattr(self, name)
            if number is not None and not 1 <= number <= MAX_OBSTACLES:
                raise ValueError(f"need {name} from 1 to {MAX_OBSTACLES}, got {number}")
        if not 0 <= self.way <= MAX_OBSTACLES:
            raise ValueError(f"need way from 0 to {MAX_OBSTACLES} points, got {self.way}")
        if not 0.0 <= self.margin <= MAX_MARGIN:
            raise ValueError(f"margin lies between 0 and {MAX_MARGIN:g} m, got {self.margin}")
        if not 1.0 <= self.view <= MAX_VIEW:
            raise ValueError(f"view lies between 1 and {MAX_VIEW:g} m, got {self.view}")
        if not 0.0 <= self.focus <= self.view:
            raise ValueError(f"focus lies between 0 and {self.view:g} m ahead, got {self.focus}")
        for name in ("detour", "failure"):
            if not 0.0 <= (penalty := getattr(self, name)) <= 100.0:
                raise ValueError(f"the penalty {name} lies between 0 and 100, got {penalty}")
        if self.capacity is not None and self.capacity < self._most_obstacles():
            raise ValueError(
                f"the fields have up to {self._most_obstacles()} obstacles, "
                f"more than capacity={self.capacity}"
            )
        _ = self.recipe  # which checks what it is made from
        self._check_gate()

    def _check_fields(self) -> None:
        number: Any = self.fields
        if type(number) is bool or not isinstance(number, (int, np.integer)):
            object.__setattr__(self, "fields", FieldPool.of(self.fields))
            for name in ("obstacles", "radii"):
                if getattr(self, name) is not None:
                    raise ValueError(
                        f"{name} changes the fields of a suite, and fields={self.fields!r} names "
                        f"others: leave {name} out"
                    )
        elif not 1 <= number <= MAX_FIELDS:
            raise ValueError(f"resets draw from 1 to {MAX_FIELDS} fields, got fields={self.fields}")

    def _check_gate(self) -> None:
        if self.gate is not None:
            shortest = PAPER_LIMITS.shortest if self.pool is None else self.pool.shortest
            if not 0.0 <= self.gate < shortest:
                raise ValueError(f"need 0 <= gate < shortest, got {self.gate} m and {shortest} m")

    def _check_numbers(self) -> None:
        whole = ("obstacles", "segments", "nearest", "rays", "way", "capacity")
        for name in (*whole, "gate", "focus", "view", "margin", "detour", "failure"):
            given = getattr(self, name)
            if given is None and name in ("obstacles", "capacity", "gate", "segments"):
                continue
            if type(given) is bool or not isinstance(given, Integral if name in whole else Real):
                a_number = "an integer" if name in whole else "a number"
                raise ValueError(f"{name} must be {a_number}, got {truncate_repr(given)}")
        if self.radii is not None and finite("radii", self.radii, (None,)).size != 2:
            raise ValueError(f"radii are (minimum, maximum), got {truncate_repr(self.radii)}")
        if self.radii is not None:  # a copy, since the caller's list may change
            object.__setattr__(self, "radii", tuple(float(radius) for radius in self.radii))

    @property
    def max_segments(self) -> int:
        """Number of segments that a flight of the fields from which resets draw may have."""
        if self.segments is not None:
            return int(self.segments)
        return PAPER_LIMITS.segments if self.pool is None else self.pool.max_segments

    @property
    def recipe(self) -> Recipe:
        """The recipe by which the obstacles of a field are drawn."""
        if self.obstacles is None and self.radii is None:
            return SUITES[self.suite]
        radii = None if self.radii is None else (self.radii[0], self.radii[1])
        return with_overrides(self.suite, self.obstacles, radii)

    @property
    def scattered(self) -> Scattered | None:
        """The recipe of the fields from which resets draw, if it draws many at once."""
        recipe = self.recipe
        return recipe if self.pool is None and isinstance(recipe, Scattered) else None

    @property
    def layout(self) -> Layout:
        """Layout of observations."""
        nearest = 0 if self.observation == "rays" else int(self.nearest)
        rays = 0 if self.observation == "discs" else int(self.rays)
        way = int(self.way)
        return Layout(nearest, rays_around(rays), float(self.focus), float(self.view), way)

    @property
    def uses_ways(self) -> bool:
        """Whether anything that is observed, rewarded or reported needs shortest paths."""
        return self.way > 0 or self.progress == WAY or self.reference

    @property
    def infos(self) -> tuple[str, ...]:
        """Keys of `info`."""
        return (*INFOS, "shortest") if self.reference else INFOS

    @property
    def max_obstacles(self) -> int:
        """Number of obstacles that a field may have."""
        return self._most_obstacles() if self.capacity is None else self.capacity

    def _most_obstacles(self) -> int:
        return self.recipe.most if self.pool is None else self.pool.max_obstacles

    @property
    def max_corners(self) -> int:
        """Number of corners of a field's obstacles, as far as it is known; 0 for discs."""
        return 0 if self.pool is None else self.pool.max_corners

    @property
    def pool(self) -> FieldPool | None:
        """The pool from which resets draw, unless they draw fields of the suite."""
        return self.fields if isinstance(self.fields, FieldPool) else None

    @property
    def number(self) -> int:
        """Number of fields from which resets draw, those of the seeds 0 to `number` - 1."""
        return int(self.fields) if self.pool is None else len(self.pool)

    @property
    def source(self) -> Hashable:
        """What decides on the field of a seed: equal for settings that give the same fields."""
        if self.pool is not None:
            return self.pool
        return self.suite, self.split, self.fields, self.obstacles, self.radii

    def drawn(self, seed: int) -> Obstacles:
        """The obstacles of a seed's field in the suite."""
        return suite_obstacles(self.suite, self.split, seed, self.recipe)

    def field(self, seed: int) -> Field:
        """The field of a seed; its name tells what was overridden.

        From a pool of n fields a seed chooses the one of the number `seed` modulo n.
        """
        if self.pool is not None:
            return self.pool[seed % len(self.pool)]
        name = f"{self.suite}/{self.split}:{seed}"
        if self.obstacles is not None:
            name += f", {self.obstacles} obstacles"
        if self.radii is not None:
            name += f", radii {self.radii[0]:g} to {self.radii[1]:g} m"
        return Field(name=name, obstacles=self.drawn(seed))

    def changed(self, changes: Mapping[str, Any]) -> Settings:
        """These settings with other values of arguments that may change between flights.

        Raises:
            ValueError: another argument, or as `Settings`.
        """
        for name in changes:
            if name not in CHANGEABLE:
                raise ValueError(
                    f"{name} does not change between flights; {', '.join(CHANGEABLE)} do"
                )
        return replace(self, **changes)

    def __deepcopy__(self, memo: Any) -> Settings:
        return self  # they cannot change


ARGUMENTS = tuple(field.name for field in dataclasses.fields(Settings))
"""Names of all arguments that scalar and vector environments share."""


def check_arguments(arguments: Iterable[str], of: str, *others: str) -> None:
    """Refuse names that are no arguments of an environment, in the words of Python itself.

    Clients that probe an environment for an argument recognise the refusal by these words.

    Args:
        arguments: names that were given.
        of: the class whose arguments they are.
        *others: names that the class knows beside those of `Settings`.

    Raises:
        TypeError: an unknown argument.
    """
    known = [*ARGUMENTS, *others]
    for name in arguments:
        if name not in known:
            raise TypeError(
                f"{of}.__init__() got an unexpected keyword argument {name!r}"
                f"{did_you_mean(name, known)}; known are {', '.join(known)}"
            )


def settings_of(arguments: dict[str, Any], of: str = "ObstacleField", *others: str) -> Settings:
    """Settings from an environment's arguments.

    Args:
        arguments: values by name.
        of: the class whose arguments they are, for the refusal of an unknown name.
        *others: names that the class knows beside those of `Settings`.

    Raises:
        TypeError: an unknown argument.
        ValueError: as `Settings`.
    """
    check_arguments(arguments, of, *others)
    return Settings(**arguments)
