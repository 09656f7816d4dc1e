"""The paper's four fields, reconstructed, and the results printed in the paper.

The paper names its fields rng(1) to rng(4) and gives no coordinates. These are rebuilt from one
stream of MATLAB's Mersenne Twister: two Latin hypercubes of 25 points as `lhsdesign` draws them,
scaled to [5, 95], then 50 radii between 3 and 7 m. That they are the paper's is likely, not proved:
rng(4) has the barrier of touching discs near (50, 40) that the paper describes, single-start is
stuck on rng(4) as it was there, and no other order of the calls that was tried is compatible with
the paper's four path lengths.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.recipes.scattered import scattered_discs

FIELDS = (1, 2, 3, 4)


def draw_discs(
    stream: np.random.RandomState,
    designs: tuple[int, ...] = (25, 25),
    smallest: float = 3.0,
    largest: float = 7.0,
) -> Obstacles:
    """Discs by the paper's recipe: Latin hypercubes on [5, 95]^2, uniform radii [m].

    Args:
        stream: randomness.
        designs: points of each hypercube.
        smallest: least radius [m].
        largest: greatest radius [m].

    Reference:
        The paper, section II.
    """
    discs = scattered_discs(stream, designs, smallest, largest)
    return Obstacles.discs(discs[:, :2], discs[:, 2])


def paper_field(number: int) -> Field:
    """The field rng(number) of the paper, reconstructed; `number` from 1 to 4.

    Raises:
        ValueError: the paper has no such field.
    """
    if number not in FIELDS:
        raise ValueError(f"the paper has fields 1 to 4, not {number}")
    return Field(name=f"paper:{number}", obstacles=draw_discs(np.random.RandomState(number)))


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """A row of the paper's Table I; None where the planner found no path."""

    evaluations: int | None
    """Function evaluations, as fmincon reported them."""
    segments: int | None
    length: float | None
    """Path length [m], by chords."""


TABLE_I: dict[tuple[str, str], TableRow] = {
    ("single-start", "paper:2"): TableRow(evaluations=None, segments=None, length=None),
    ("single-start", "paper:4"): TableRow(evaluations=None, segments=None, length=None),
    ("multi-start", "paper:1"): TableRow(evaluations=10205, segments=11, length=157.7259),
    ("multi-start", "paper:2"): TableRow(evaluations=11275, segments=11, length=153.6096),
    ("multi-start", "paper:3"): TableRow(evaluations=11256, segments=11, length=150.8103),
    ("multi-start", "paper:4"): TableRow(evaluations=6849, segments=11, length=145.0263),
}
"""The paper's Table I by planner and field."""


def is_from_paper(field: Field) -> bool:
    """Whether a field is the paper's field of that name, with its limits.

    A JSON file may have the same name.
    """
    family, _, number = field.name.partition(":")
    known = family == "paper" and number in map(str, FIELDS)
    if not known or not field.obstacles.are_discs:
        return False
    own = paper_field(int(number))
    assert own.obstacles.are_discs
    pairs = (
        (field.obstacles.centers, own.obstacles.centers),
        (field.obstacles.radii, own.obstacles.radii),
        (field.start, own.start),
        (field.goal, own.goal),
        (field.bounds, own.bounds),
    )
    same = all(np.array_equal(given, paper) for given, paper in pairs)
    return same and field.limits == own.limits
