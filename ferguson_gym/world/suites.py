"""Suites of random fields: pure functions of (suite, split, seed) whose fields never change.

A new recipe is a new suite. NumPy's RandomState is used because its stream is frozen; it is
keyed by suite, split and seed, so splits never share a stream.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ferguson_gym.runtime.arrays import Array, truncate_repr
from ferguson_gym.runtime.suggestions import did_you_mean
from ferguson_gym.world.field import GOAL, START, Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.paper_fields import draw_discs
from ferguson_gym.world.recipes.mersenne_twister import Words
from ferguson_gym.world.recipes.scattered import Integers, latin_hypercube, scatter
from ferguson_gym.world.recipes.town import MOST as MOST_IN_TOWN
from ferguson_gym.world.recipes.town import town
from ferguson_gym.world.recipes.walls import MOST as MOST_WALLS
from ferguson_gym.world.recipes.walls import walls

SPLITS = ("train", "validation", "test")
"""Train and tune on train, select on validation, evaluate once on test."""
LAST_SEED = 2**63 - 1


class Draw(Protocol):
    """Draws the obstacles of a field from a stream of random numbers."""

    def __call__(self, stream: np.random.RandomState) -> Obstacles:
        """Obstacles of one field."""


class Recipe(Draw, Protocol):
    """What a suite is made by: it also knows how many obstacles a field may have."""

    @property
    def most(self) -> int:
        """Upper limit of the obstacles of a field."""


@dataclass(frozen=True, slots=True)
class Scattered:
    """The paper's recipe, Latin hypercubes of discs, with other numbers and radii.

    Raises:
        ValueError: radii that are not 0 < smallest <= largest <= 7 m
            (a larger disc could cover start or goal).
    """

    designs: tuple[int, ...]
    """Points of each Latin hypercube."""
    smallest: float
    """Least radius [m]."""
    largest: float
    """Greatest radius [m]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest <= self.largest <= 7.0:
            raise ValueError(
                "need 0 < smallest <= largest <= 7 m for radii (larger discs could cover start "
                f"or goal), got {self.smallest} and {self.largest}"
            )

    def __call__(self, stream: np.random.RandomState) -> Obstacles:
        """Discs of one field."""
        return draw_discs(stream, self.designs, self.smallest, self.largest)

    def draw_many(self, keys: Words, slots: Integers, discs: Array) -> None:
        """Discs of many fields, the same numbers as one by one.

        Args:
            keys: (fields, 4) of the streams, from `stream_keys`.
            slots: (fields,) where each is written.
            discs: (all slots, 3, M) with room for `most` discs, filled with x, y and radius [m].
        """
        if discs.shape[2] < self.most:
            raise ValueError(f"{self.most} discs do not fit into {discs.shape[2]}")
        designs = np.array(self.designs, np.int64)
        scatter(keys, designs, self.smallest, self.largest, slots, discs)

    @property
    def most(self) -> int:
        """Number of discs of every field."""
        return sum(self.designs)


@dataclass(frozen=True, slots=True)
class Fixed:
    """A recipe without numbers that could be others."""

    draw: Draw
    most: int
    """Upper limit of the obstacles of a field."""

    def __call__(self, stream: np.random.RandomState) -> Obstacles:
        """Obstacles of one field."""
        return self.draw(stream)


def traps(stream: np.random.RandomState) -> Obstacles:
    """Five pockets, arcs of overlapping discs that open towards the start, and 12 discs.

    A pocket is an arc of 200 to 260 degrees with a radius of 9 to 13 m; its mouth turns up
    to 40 degrees from the start's side. Discs within 6 m of start or goal are left out.
    """
    centers: list[Array] = []
    radii: list[float] = []
    for middle in 60.0 * latin_hypercube(stream, 5) + 20.0:
        radius, thickness, span, turn = stream.random_sample(4)
        radius, thickness = 9.0 + 4.0 * radius, 2.0 + thickness
        half_span = np.radians(100.0 + 30.0 * span)
        away = np.pi / 4 + np.radians(80.0 * turn - 40.0)
        number = int(np.ceil(2 * half_span * radius / (1.5 * thickness))) + 1
        for angle in np.linspace(away - half_span, away + half_span, number):
            center = middle + radius * np.array([np.cos(angle), np.sin(angle)])
            centers.append(center.round(9))  # sine and cosine differ between C libraries
            radii.append(thickness)
    single = draw_discs(stream, (6, 6), largest=5.0)
    every = Obstacles.discs(
        np.vstack([*centers, single.centers]), np.concatenate([radii, single.radii])
    )
    # inside [5, 95] no ring of discs can close around start or goal
    inside = ((every.centers >= 5.0) & (every.centers <= 95.0)).all(axis=1)
    room = every.signed_distance(np.array([START, GOAL])).min(axis=0) >= 6.0
    return Obstacles.discs(every.centers[inside & room], every.radii[inside & room])


SUITES: dict[str, Recipe] = {
    "standard": Scattered((25, 25), 3.0, 7.0),
    "sparse": Scattered((10, 10), 3.0, 7.0),
    "dense": Scattered((35, 35), 3.0, 7.0),
    "forest": Scattered((60, 60, 60), 0.5, 1.5),
    "traps": Fixed(traps, 5 * 21 + 12),  # five pockets of at most 21 discs, and 12 single discs
    "town": Fixed(town, MOST_IN_TOWN),
    "walls": Fixed(walls, MOST_WALLS),
}
"""Recipes by name."""

_KEYS = {name: 1 + index for index, name in enumerate(SUITES)}


def suite_field(suite: str, split: str, seed: int) -> Field:
    """The field `SUITE/SPLIT:SEED`.

    Raises:
        ValueError: an unknown suite or split, or a seed outside 0..2**63 - 1.
    """
    obstacles = suite_obstacles(suite, split, seed)
    return Field(name=f"{suite}/{split}:{seed}", obstacles=obstacles)


def suite_obstacles(suite: str, split: str, seed: int, recipe: Draw | None = None) -> Obstacles:
    """The obstacles of a suite's field, or those that another recipe draws from its stream.

    Raises:
        ValueError: as `suite_field`.
    """
    check_suite(suite, split)
    if not 0 <= seed <= LAST_SEED:
        raise ValueError(f"a field's seed lies between 0 and 2**63 - 1, got {seed}")
    keys = stream_keys(suite, split, np.array([seed]))
    recipe = recipe or SUITES[suite]
    if not isinstance(recipe, Scattered):
        return recipe(np.random.RandomState(keys[0]))
    discs = np.empty((1, 3, recipe.most))
    recipe.draw_many(keys, np.zeros(1, np.int64), discs)
    return Obstacles.discs(discs[0, :2].T, discs[0, 2])


def stream_keys(suite: str, split: str, seeds: Integers) -> Words:
    """Keys (n, 4) of the streams `RandomState(key)` from which fields of seeds (n,) are drawn."""
    keys = np.empty((len(seeds), 4), np.uint32)
    keys[:, 0], keys[:, 1] = _KEYS[suite], SPLITS.index(split)
    keys[:, 2], keys[:, 3] = seeds % 2**32, seeds // 2**32
    return keys


def check_suite(suite: str, split: str) -> None:
    """Refuse unknown names.

    Raises:
        ValueError: an unknown suite or split.
    """
    if suite not in SUITES:
        near = did_you_mean(str(suite), SUITES)
        raise ValueError(
            f"unknown suite {truncate_repr(suite)}{near}; suites are {', '.join(SUITES)}"
        )
    if split not in SPLITS:
        near = did_you_mean(str(split), SPLITS)
        raise ValueError(
            f"unknown split {truncate_repr(split)}{near}; splits are {', '.join(SPLITS)}"
        )


def with_overrides(
    suite: str, obstacles: int | None = None, radii: tuple[float, float] | None = None
) -> Scattered:
    """A suite's recipe with another number of obstacles or other radii (least, greatest) [m].

    Raises:
        ValueError: a suite that is not scattered discs, or numbers that make no recipe.

    Example:
        >>> with_overrides("standard", obstacles=11).designs
        (5, 6)
    """
    recipe = SUITES[suite]
    if not isinstance(recipe, Scattered):
        scattered = ", ".join(name for name, one in SUITES.items() if isinstance(one, Scattered))
        raise ValueError(
            f"the obstacles of suite {truncate_repr(suite)} are fixed; their number and radii can "
            f"be changed in {scattered}"
        )
    if obstacles is not None:
        if obstacles < 0:
            raise ValueError(f"a field has 0 obstacles or more, got {obstacles}")
        number = len(recipe.designs)
        sizes = ((obstacles + k) // number for k in range(number))
        recipe = replace(recipe, designs=tuple(size for size in sizes if size))
    if radii is not None:
        smallest, largest = radii
        recipe = replace(recipe, smallest=float(smallest), largest=float(largest))
    return recipe
