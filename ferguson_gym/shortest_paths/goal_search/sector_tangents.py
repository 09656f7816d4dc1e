"""The free tangents that leave an eighth of a track, made when a search needs them.

The cells of a grid are walked away from the disc, column by column in the direction of the octant.
Of each column only the cells between the outermost lines of bins that are still open are visited,
so that far from the disc the walk follows a few thin beams. It ends where all bins are hidden, or
beyond the bounds, or where no path that is short enough can lead.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.shortest_paths.goal_search.disc_grid import Grid, cells_around, is_passed
from ferguson_gym.shortest_paths.goal_search.tangent_bins import (
    BINS,
    COSINES,
    SINES,
    SLOPES,
    Bins,
    Candidate,
    Frame,
    add_disc,
    into_frame,
    make_frame,
)
from ferguson_gym.shortest_paths.shapes import TWO_PI, Integers, Records
from ferguson_gym.shortest_paths.tangent_graph import GOAL, WALL
from ferguson_gym.shortest_paths.tangents import angle, is_within

EIGHTH = TWO_PI / 8.0


class Site(NamedTuple):
    """What a search needs to know of a field."""

    discs: Records
    """(n + 2,) those that can obstruct a path, then goal and start as discs of radius zero."""
    grid: Grid
    """Of all but the start."""
    box: Array
    """(2, 2) least and greatest coordinates, and the margin beyond [m]."""
    margin: float
    """[m]."""
    stamp: Integers
    """(n + 2,) when each disc was last seen."""


class Exit(NamedTuple):
    """A tangent that leaves a track, or a wall."""

    angle: float
    """Where it leaves, in the track's sense [rad]."""
    other: int
    """The track that is reached, GOAL or WALL."""
    there: float
    """The angle at which it is reached [rad]."""
    line: float
    """Length of the tangent [m]."""
    x: float
    """Where it ends [m]."""
    y: float


@compiled
def sector_of(at: float) -> int:
    """The eighth of a track in which an angle from 0 to a full turn lies."""
    return min(int(at / EIGHTH), 7)


@compiled
def add_exits(
    site: Site, track: int, sector: int, bound: float, mark: int, exits: list[Exit]
) -> None:
    """Append the exits of a sector of a track, in the order of their angles.

    Args:
        site: discs and grid.
        track: in the numbering of `Tangents`.
        sector: 0 to 7.
        bound: length of the paths sought [m]; tangents that only longer ones use may be left out.
        mark: greater than all stamps so far; it and the next number become stamps.
        exits: the list that grows.
    """
    i, sense = track // 2, 1.0 - 2.0 * (track % 2)
    discs = site.discs
    one, goal, start = discs[i], discs[len(discs) - 2], discs[len(discs) - 1]
    # a track's way is a quarter turn ahead of the angle
    octant = (sector + 2) % 8 if sense > 0.0 else (5 - sector) % 8
    frame = make_frame(octant, sense, one.radius)
    bins = Bins(np.full(BINS, np.inf), np.full(BINS, -1))
    links = [(0, 0) for _ in range(0)]
    candidates = [Candidate(0, 0.0, 0.0, 0.0, 0.0, 0) for _ in range(0)]
    count = len(exits)
    touching = _touching(site, i, mark)
    site.stamp[i] = mark + 1
    for k in touching:
        # lines may begin and end inside these, where the walk does not meet their boundaries
        site.stamp[k] = mark + 1
        add_disc(discs, i, sense, k, site.margin, frame, bins, links, candidates)
    _walk(site, i, sense, frame, bound, mark + 1, bins, links, candidates)
    for way in candidates:
        at = angle(sense, way.ux, way.uy)
        if way.length > bins.hidden[way.bin] or sector_of(at) != sector:
            continue
        two = discs[way.disc]
        r, s = sense * one.radius, way.sense * two.radius
        x, y, end_x, end_y = (
            one.x + r * way.uy,
            one.y - r * way.ux,
            two.x + s * way.uy,
            two.y - s * way.ux,
        )
        if not is_within(site.box, end_x, end_y):
            continue
        # the start may lie outside of the bounds by a tolerance
        if one.radius > 0.0 and not is_within(site.box, x, y):
            continue
        ahead = np.hypot(goal.x - end_x, goal.y - end_y)
        if np.hypot(x - start.x, y - start.y) + way.length + ahead > bound:
            continue
        if not _is_free(site, i, way, x, y, bins.latest[way.bin], links):
            continue
        other = 2 * way.disc + (0 if way.sense > 0.0 else 1)
        there = angle(way.sense, way.ux, way.uy)
        if way.disc == len(discs) - 2:
            other, there = GOAL, 0.0
        exits.append(Exit(at, other, there, way.length, end_x, end_y))
    _add_walls(site, i, sense, sector, touching, exits)
    # by insertion, since they are few
    for place in range(count + 1, len(exits)):
        moved, k = exits[place], place
        while k > count and exits[k - 1].angle > moved.angle:
            exits[k] = exits[k - 1]
            k -= 1
        exits[k] = moved


@compiled
def _touching(site: Site, i: int, mark: int) -> list[int]:
    """The discs that cover a part of a disc's boundary by more than the margin."""
    found = [0 for _ in range(0)]
    discs, grid, one = site.discs, site.grid, site.discs[i]
    if one.radius == 0.0:
        return found
    left, right, bottom, top = cells_around(grid, one.x, one.y, one.radius)
    for column in range(left, right + 1):
        for row in range(bottom, top + 1):
            if not is_passed(grid, column, row, one.x, one.y, one.radius):
                continue
            cell = column * grid.rows + row
            for place in range(grid.first[cell], grid.first[cell + 1]):
                k = grid.member[place]
                if site.stamp[k] == mark:
                    continue
                site.stamp[k] = mark
                dx, dy = discs[k].x - one.x, discs[k].y - one.y
                if k != i and abs(np.sqrt(dx * dx + dy * dy) - one.radius) < discs[k].reach:
                    found.append(k)
    return found


@compiled
def _add_walls(
    site: Site, i: int, sense: float, sector: int, touching: list[int], exits: list[Exit]
) -> None:
    """Append the walls of a sector: where its boundary is covered most deeply."""
    one, box = site.discs[i], site.box
    if one.radius == 0.0:
        return
    angles = [
        math.atan2(site.discs[k].y - one.y, site.discs[k].x - one.x) % TWO_PI for k in touching
    ]
    if one.x + one.radius > box[1, 0]:
        angles.append(0.0)
    if one.y + one.radius > box[1, 1]:
        angles.append(0.25 * TWO_PI)
    if one.x - one.radius < box[0, 0]:
        angles.append(0.5 * TWO_PI)
    if one.y - one.radius < box[0, 1]:
        angles.append(0.75 * TWO_PI)
    for middle in angles:
        at = middle if sense > 0.0 else -middle % TWO_PI
        if sector_of(at) == sector:
            exits.append(Exit(at, WALL, 0.0, 0.0, 0.0, 0.0))


@compiled
def _is_free(
    site: Site, i: int, way: Candidate, x: float, y: float, link: int, links: list[tuple[int, int]]
) -> bool:
    """Whether a candidate from (x, y) meets none of the discs linked with its bin."""
    while link >= 0:
        k, link = links[link]
        if k in (i, way.disc):
            continue
        disc = site.discs[k]
        dx, dy = disc.x - x, disc.y - y
        reach = disc.reach
        if site.discs[i].radius == 0.0:
            reach = min(reach, np.sqrt(dx * dx + dy * dy) - site.margin)
        beside = dx * way.uy - dy * way.ux
        if abs(beside) >= reach:
            continue
        along = dx * way.ux + dy * way.uy
        beyond = -along if along < 0.0 else max(along - way.length, 0.0)
        if beside * beside + beyond * beyond < reach * reach:
            return False
    return True


@compiled
def _is_beyond(site: Site, cell: int, bound: float) -> bool:
    """Whether no path from start to goal of a length [m] reaches a cell."""
    grid, discs = site.grid, site.discs
    goal, start = discs[len(discs) - 2], discs[len(discs) - 1]
    x = grid.x + grid.size * (cell // grid.rows + 0.5)
    y = grid.y + grid.size * (cell % grid.rows + 0.5)
    least = np.hypot(x - start.x, y - start.y) + np.hypot(x - goal.x, y - goal.y)
    beyond: bool = least - math.sqrt(2.0) * grid.size > bound
    return beyond


@compiled
def _walk(
    site: Site,
    i: int,
    sense: float,
    frame: Frame,
    bound: float,
    mark: int,
    bins: Bins,
    links: list[tuple[int, int]],
    candidates: list[Candidate],
) -> None:
    """Enter the discs that the lines of an octant may meet."""
    grid, one, shift = site.grid, site.discs[i], frame.shift
    # in the frame: the centre, from the grid's corner where coordinates are least
    ahead, aside = into_frame(frame, one.x - grid.x, one.y - grid.y)
    wide, high = grid.columns, grid.rows
    columns, rows = (high, wide) if frame.swapped else (wide, high)
    size = grid.size
    ahead += 0.0 if frame.first > 0.0 else columns * size
    aside += 0.0 if frame.second > 0.0 else rows * size
    pad = grid.pad + 1e-9 * size
    is_open = np.ones(BINS, dtype=np.bool_)
    least = ahead - max(shift * SINES[0], shift * SINES[BINS]) - pad
    column = int(min(max(math.floor(least / size), 0.0), columns - 1.0))
    left = BINS
    while column < columns and left > 0:
        begin, end = column * size, (column + 1) * size
        # square of the least length of a line that ends in this column or behind it
        passed = max(begin - ahead, 0.0) ** 2 - one.radius**2
        left, place = 0, 0
        for k in range(BINS):
            if passed > 0.0 and passed > bins.hidden[k] ** 2:
                is_open[k] = False
        while place < BINS:
            if not is_open[place]:
                place += 1
                continue
            first = place
            while place < BINS and is_open[place]:
                place += 1
            bottom, top, begins = _span(ahead, aside, shift, first, place, begin, end, pad)
            low = int(max(math.floor(bottom / size), 0.0))
            highest = int(min(math.floor(top / size), rows - 1.0))
            alive = begins
            for row in range(low, highest + 1):
                x = column if frame.first > 0.0 else columns - 1 - column
                y = row if frame.second > 0.0 else rows - 1 - row
                cell = y * grid.rows + x if frame.swapped else x * grid.rows + y
                if bound < np.inf and _is_beyond(site, cell, bound):
                    continue
                alive = True
                for member in range(grid.first[cell], grid.first[cell + 1]):
                    k = grid.member[member]
                    if site.stamp[k] != mark:
                        site.stamp[k] = mark
                        add_disc(
                            site.discs, i, sense, k, site.margin, frame, bins, links, candidates
                        )
            if alive:
                left += place - first
            else:
                # bounds and ellipse are convex: lines that have left them do not return
                is_open[first:place] = False
        column += 1


@compiled
def _span(
    ahead: float,
    aside: float,
    shift: float,
    first: int,
    last: int,
    begin: float,
    end: float,
    pad: float,
) -> tuple[float, float, bool]:
    """The part of a column that lines between two edges of bins pass, and whether any begin there.

    Lines with greater slopes lie higher, but for their backward extensions.
    """
    bottom, top, begins = np.inf, -np.inf, False
    for edge in (first, last):
        if ahead - shift * SINES[edge] > begin - pad:
            begins = True
    for edge in (first, last):
        x, y = ahead - shift * SINES[edge], aside + shift * COSINES[edge]
        if begins:
            bottom, top = min(bottom, y), max(top, y)
        if x <= begin:
            bottom = min(bottom, y + SLOPES[edge] * (begin - x))
        if x <= end:
            top = max(top, y + SLOPES[edge] * (end - x))
    return bottom - pad, top + pad, begins
