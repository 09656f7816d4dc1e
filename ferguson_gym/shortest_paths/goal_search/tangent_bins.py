"""What hides what from an eighth of a track: bins of directions, filled disc by disc.

Every point outside a disc lies on exactly one line that leaves the disc's track tangentially. So
these lines are to a track what rays are to a point: another disc hides what lies behind it, and
the lines that meet it are those between its two tangents. The directions of an eighth of a track
span one octant and are sorted into bins. A bin records from which distance on everything in it is
hidden, and the discs that may block a line in it.

A frame turns and mirrors the plane so that the directions of an octant have slopes from 0 to 1.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.shapes import TWO_PI, Integers, Records
from ferguson_gym.shortest_paths.tangents import tangent

BINS = 128
"""Bins of an octant, of equal widths in slope."""
SLOPES = np.arange(BINS + 1) / BINS
COSINES = 1.0 / np.sqrt(1.0 + SLOPES**2)
SINES = SLOPES * COSINES
_MIDDLE = math.tan(TWO_PI / 16.0)
"""Slope of the middle of an octant."""
_ROUNDING = 1e-6
"""A line this close to the edge of a bin is in both bins, in widths of a bin."""
_BENT = 2e-4
"""By how much a disc beside a bin may come nearer to its lines than at its edges, relative to the
distance of the centres; above 1 - cos of half a bin."""


class Frame(NamedTuple):
    """Coordinates for one octant of directions and one track."""

    swapped: bool
    """Whether the first coordinate is y."""
    first: float
    """Sign of the first coordinate."""
    second: float
    """Sign of the second coordinate."""
    mirrored: bool
    shift: float
    """By how much lines of the track lie beside its centre, on their left in the frame [m]."""


class Candidate(NamedTuple):
    """A tangent that has yet to be tested for collisions."""

    disc: int
    """The disc that it reaches,"""
    sense: float
    """and the sense of the track there."""
    length: float
    """[m]."""
    ux: float
    """Unit direction."""
    uy: float
    bin: int


class Bins(NamedTuple):
    """What is known of each bin."""

    hidden: Array
    """(BINS,) length beyond which no tangent in the bin is free [m]."""
    latest: Integers
    """(BINS,) the bin's last link, -1 for none; a link is a disc and the link before it."""


@compiled
def make_frame(octant: int, sense: float, radius: float) -> Frame:
    """The frame for directions from octant / 8 to (octant + 1) / 8 of a turn."""
    mirrored = octant % 2 == 1
    return Frame(
        octant in (1, 2, 5, 6),
        1.0 if octant in (0, 1, 2, 7) else -1.0,
        1.0 if octant in (0, 1, 3, 6) else -1.0,
        mirrored,
        sense * radius if mirrored else -sense * radius,
    )


@compiled
def into_frame(frame: Frame, x: float, y: float) -> tuple[float, float]:
    """A vector in the coordinates of a frame."""
    if frame.swapped:
        return frame.first * y, frame.second * x
    return frame.first * x, frame.second * y


@compiled
def bin_of(ahead: float, aside: float) -> int:
    """The bin of a direction of the octant."""
    return int(min(max(BINS * aside / ahead, 0.0), BINS - 1.0))


@compiled
def add_disc(
    discs: Records,
    i: int,
    sense: float,
    k: int,
    margin: float,
    frame: Frame,
    bins: Bins,
    links: list[tuple[int, int]],
    candidates: list[Candidate],
) -> None:
    """Enter disc k into the bins of a track of disc i, and its tangents among the candidates."""
    one, two = discs[i], discs[k]
    dx, dy = two.x - one.x, two.y - one.y
    apart = np.sqrt(dx * dx + dy * dy)
    # a point may lie in a disc by a tolerance: lines from it are then as deep
    reach = two.reach if one.radius > 0.0 else min(two.reach, apart - margin)
    if apart > one.radius + two.radius + margin:
        _add_apart(dx, dy, apart, one.radius, two.radius, sense, k, reach - margin, frame, bins,
                   links, candidates)  # fmt: skip
    elif apart > 0.0:
        _add_near(dx, dy, apart, one.radius, two.radius, sense, k, reach - margin, frame, bins,
                  links, candidates, margin)  # fmt: skip


@compiled
def _add_apart(
    dx: float,
    dy: float,
    apart: float,
    radius: float,
    other: float,
    sense: float,
    k: int,
    deep: float,
    frame: Frame,
    bins: Bins,
    links: list[tuple[int, int]],
    candidates: list[Candidate],
) -> None:
    """Discs that do not meet: the second one is met by the lines between its two tangents."""
    low, high = -np.inf, np.inf
    for way in (1.0, -1.0):
        length, ux, uy = tangent(dx, dy, way * other - sense * radius)
        ahead, aside = into_frame(frame, ux, uy)
        at = np.inf if aside > _MIDDLE * ahead else -np.inf
        if ahead > 0.0:
            at = BINS * aside / ahead
        # in the frame, a disc on the left of its tangent has the greater slopes
        if (way > 0.0) != frame.mirrored:
            low = at
        else:
            high = at
        if abs(at - 0.5 * BINS) <= 0.5 * BINS + _ROUNDING and (other > 0.0 or way > 0.0):
            place = bin_of(ahead, aside)
            if length <= bins.hidden[place]:
                candidates.append(Candidate(k, way, length, ux, uy, place))
    if low > high:  # the lines between are less than half a turn, on one side of the octant's back
        if low < np.inf:
            high = np.inf
        elif high > -np.inf:
            low = -np.inf
    if other == 0.0 or high < -_ROUNDING or low > BINS + _ROUNDING:
        return
    low, high = max(low, -1.0), min(high, BINS + 1.0)
    first = max(math.floor(low - _ROUNDING), 0)
    last = min(math.floor(high + _ROUNDING), BINS - 1)
    nearest = (apart - other) ** 2 - radius * radius  # square of the least length of a line to it
    for place in range(first, last + 1):
        if nearest <= bins.hidden[place] * abs(bins.hidden[place]):
            links.append((k, bins.latest[place]))
            bins.latest[place] = len(links) - 1
    # lines in the bins between end in the disc before its centre is passed
    u, v = into_frame(frame, dx, dy)
    first, last = max(math.ceil(low), 0), min(math.floor(high), BINS)
    while first < last and abs(v * COSINES[first] - u * SINES[first] - frame.shift) >= deep:
        first += 1
    while first < last and abs(v * COSINES[last] - u * SINES[last] - frame.shift) >= deep:
        last -= 1
    for place in range(first, last):
        bins.hidden[place] = min(bins.hidden[place], apart)


@compiled
def _add_near(
    dx: float,
    dy: float,
    apart: float,
    radius: float,
    other: float,
    sense: float,
    k: int,
    deep: float,
    frame: Frame,
    bins: Bins,
    links: list[tuple[int, int]],
    candidates: list[Candidate],
    margin: float,
) -> None:
    """Discs that meet: every bin is looked at, since lines may begin inside the second one."""
    u, v = into_frame(frame, dx, dy)
    beside, along = v * COSINES[0] - u * SINES[0] - frame.shift, u * COSINES[0] + v * SINES[0]
    for place in range(BINS):
        before, beyond = beside, along
        beside = v * COSINES[place + 1] - u * SINES[place + 1] - frame.shift
        along = u * COSINES[place + 1] + v * SINES[place + 1]
        low, high = min(before, beside), max(before, beside)
        room = other + margin + (_BENT * apart if along * beyond <= 0.0 else 0.0)
        if low < room and high > -room and max(along, beyond) > -room:
            links.append((k, bins.latest[place]))
            bins.latest[place] = len(links) - 1
            if low > -deep and high < deep and min(along, beyond) > 0.0:
                bins.hidden[place] = min(bins.hidden[place], apart)
    for way in (1.0, -1.0):
        across = way * other - sense * radius
        # a point may lie inside the disc by more than the margin
        if (radius > 0.0 and abs(across) > apart + margin) or (other == 0.0 and way < 0.0):
            continue
        length, ux, uy = tangent(dx, dy, across)
        ahead, aside = into_frame(frame, ux, uy)
        if -_ROUNDING <= aside <= ahead + _ROUNDING:
            place = bin_of(ahead, aside)
            if length <= bins.hidden[place]:
                candidates.append(Candidate(k, way, length, ux, uy, place))
