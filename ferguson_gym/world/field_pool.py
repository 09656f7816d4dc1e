"""A pool of fields from which the resets of an environment draw."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import accumulate
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from ferguson_gym.runtime.arrays import truncate_repr
from ferguson_gym.world.field import Field, planar_obstacles
from ferguson_gym.world.field_names import GRAMMAR, family, get_fields
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.suites import SUITES, suite_field

MAX_FIELDS = 1_000_000
"""Upper limit of the fields from which resets draw; each takes an entry of an array."""


@dataclass(frozen=True, slots=True)
class SuiteRange:
    """Consecutive fields of a suite, which are drawn when they are asked for."""

    suite: str
    split: str
    seeds: range

    def __len__(self) -> int:
        return len(self.seeds)

    def __getitem__(self, index: int) -> Field:
        return suite_field(self.suite, self.split, self.seeds[index])

    @property
    def max_obstacles(self) -> int:
        """Number of obstacles that such a field may have."""
        return SUITES[self.suite].most


@dataclass(frozen=True, slots=True, repr=False)
class FieldPool:
    """Fields by number, in the order in which they were given.

    Fields of suites are drawn when they are asked for; files are read once, when the pool is made.

    Args:
        parts: ranges of a suite's fields, and fields; `FieldPool.of` makes them of names.

    Raises:
        ValueError: a field that is not planar, no field, or more than `MAX_FIELDS`.
    """

    parts: tuple[SuiteRange | Field, ...]
    _ends: tuple[int, ...] = field(init=False, compare=False)

    def __post_init__(self) -> None:
        sizes = (len(part) if isinstance(part, SuiteRange) else 1 for part in self.parts)
        object.__setattr__(self, "_ends", tuple(accumulate(sizes)))
        if not 1 <= len(self) <= MAX_FIELDS:
            raise ValueError(f"resets draw from 1 to {MAX_FIELDS} fields, got {len(self)}")
        for part in self.parts:
            if isinstance(part, Field):
                planar_obstacles(part)

    @classmethod
    def of(cls, given: Any) -> FieldPool:
        """The pool that some fields make.

        Args:
            given: a `Field`, a name such as `forest/train:0-99`, a JSON file, a directory of such
                files, or several of these.

        Raises:
            ValueError: something else, an unknown name, or as `FieldPool`.

        Example:
            >>> pool = FieldPool.of(["paper:1-4", "forest/train:0-99"])
            >>> len(pool), pool[5].name
            (104, 'forest/train:1')
        """
        several = isinstance(given, Iterable) and not isinstance(given, (str, PathLike, FieldPool))
        parts: list[SuiteRange | Field] = []
        for one in given if several else [given]:
            parts += _parts(one)
        return cls(tuple(parts))

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, index: int) -> Field:
        """The field of a number from 0 to the length of the pool, exclusive."""
        if not 0 <= index < len(self):
            raise IndexError(f"the pool has fields 0 to {len(self) - 1}, not {index}")
        k = bisect_right(self._ends, index)
        part = self.parts[k]
        if isinstance(part, Field):
            return part
        return part[index - (self._ends[k - 1] if k else 0)]

    @property
    def max_obstacles(self) -> int:
        """Number of obstacles that a field may have."""
        return max(
            len(part.obstacles) if isinstance(part, Field) else part.max_obstacles
            for part in self.parts
        )

    @property
    def max_corners(self) -> int:
        """Number of corners that the obstacles of a field given as such may have; 0 for discs."""
        given = (part for part in self.parts if isinstance(part, Field))
        return max((corners_of(part.obstacles) for part in given), default=0)

    @property
    def max_segments(self) -> int:
        """Number of segments that a flight may have."""
        return max(limits.segments for limits in self._limits())

    @property
    def shortest(self) -> float:
        """Least of the fields' minimum segment lengths [m]."""
        return min(limits.shortest for limits in self._limits())

    def _limits(self) -> list[Limits]:
        return [part.limits if isinstance(part, Field) else PAPER_LIMITS for part in self.parts]

    def __repr__(self) -> str:
        return f"FieldPool({len(self)} fields, the first {self[0].name})"

    def __deepcopy__(self, memo: Any) -> FieldPool:
        return self  # it cannot change


def corners_of(obstacles: Obstacles) -> int:
    """Number of corners of cores for which there must be room; 0 for discs, which need none."""
    return 0 if obstacles.are_discs else len(obstacles.points)


def _parts(given: Any) -> tuple[SuiteRange | Field, ...]:
    if isinstance(given, FieldPool):
        return given.parts
    if isinstance(given, Field):
        return (given,)
    if not isinstance(given, (str, PathLike)):
        raise ValueError(
            "fields is a number, or the fields to draw from: "
            f"a Field, a name or a path, or a list of these, got {truncate_repr(given)}; {GRAMMAR}"
        )
    name = str(fspath(given))
    if name and not Path(name).exists():
        kind, seeds = family(name)
        suite, slash, split = kind.partition("/")
        if slash:
            return (SuiteRange(suite, split, seeds),)
    return tuple(get_fields(name))
