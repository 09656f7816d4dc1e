"""Suites of random fields: pure functions of (suite, split, seed) whose fields never change.

A new recipe is a new suite. NumPy's RandomState is used because its stream is frozen; it is
keyed by suite, split and seed, so splits never share a stream.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ferguson_gym.arrays import Array
from ferguson_gym.fields import GOAL, START, Field
from ferguson_gym.obstacles import Discs
from ferguson_gym.paper import draw_discs, latin_hypercube

SPLITS = ("train", "validation", "test")
"""Tune on train, choose on validation, open test once."""
LAST_SEED = 2**63 - 1


def standard(stream: np.random.RandomState) -> Discs:
    """The paper's recipe: 50 discs of 3 to 7 m."""
    return draw_discs(stream)


def sparse(stream: np.random.RandomState) -> Discs:
    """20 discs of 3 to 7 m."""
    return draw_discs(stream, per_design=10)


def dense(stream: np.random.RandomState) -> Discs:
    """70 discs of 3 to 7 m."""
    return draw_discs(stream, per_design=35)


def forest(stream: np.random.RandomState) -> Discs:
    """180 thin trunks of 0.5 to 1.5 m."""
    return draw_discs(stream, per_design=60, designs=3, smallest=0.5, largest=1.5)


def traps(stream: np.random.RandomState) -> Discs:
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
    single = draw_discs(stream, per_design=6, largest=5.0)
    every = Discs(np.vstack([*centers, single.centers]), np.concatenate([radii, single.radii]))
    # inside [5, 95] no ring of discs can close around start or goal
    inside = ((every.centers >= 5.0) & (every.centers <= 95.0)).all(axis=1)
    room = every.signed_distance(np.array([START, GOAL])).min(axis=0) >= 6.0
    return Discs(every.centers[inside & room], every.radii[inside & room])


SUITES: dict[str, Callable[[np.random.RandomState], Discs]] = {
    "standard": standard,
    "sparse": sparse,
    "dense": dense,
    "forest": forest,
    "traps": traps,
}
"""Recipes by name."""

_KEYS = {name: 1 + index for index, name in enumerate(SUITES)}


def suite_field(suite: str, split: str, seed: int) -> Field:
    """The field `SUITE/SPLIT:SEED`.

    Raises:
        ValueError: an unknown suite or split, or a seed outside 0..2**63 - 1.
    """
    if suite not in SUITES:
        raise ValueError(f"unknown suite {suite!r}; suites are {', '.join(SUITES)}")
    if split not in SPLITS:
        raise ValueError(f"unknown split {split!r}; splits are {', '.join(SPLITS)}")
    if not 0 <= seed <= LAST_SEED:
        raise ValueError(f"a field's seed lies between 0 and 2**63 - 1, got {seed}")
    key = [_KEYS[suite], SPLITS.index(split), seed % 2**32, seed // 2**32]
    stream = np.random.RandomState(key)
    return Field(name=f"{suite}/{split}:{seed}", obstacles=SUITES[suite](stream))
