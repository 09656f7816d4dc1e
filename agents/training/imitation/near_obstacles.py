"""The obstacles that a vehicle's next segment can meet, as rows of numbers in its frame.

The penalty on violations measures distances from them, whatever the learner observes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.convex_core import has_core
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.simulation.field_store import FieldArrays, cores_of
from ferguson_gym.simulation.observed_cores import nearest_outline_point
from ferguson_gym.simulation.step_buffers import Records, StepBuffers
from ferguson_gym.world.limits import PAPER_LONGEST

NUMBER = 12
"""Rows for each vehicle."""
FOCUS = 8.0
"""The obstacles nearest to the point this far ahead are chosen [units of the field]."""
VIEW = 30.0
"""Those farther from that point than this are left out [units of the field]."""
MOST_CORNERS = 8
"""Corners of a core that a row holds; of a core that has more, those that follow each other nearest
to that point: their hull is a part of the obstacle."""

Numbers = NDArray[np.float32]


def near_obstacles(buffers: StepBuffers) -> tuple[Numbers, Numbers]:
    """Obstacles near vehicles: rows (n, NUMBER, 2 C + 1), and which are present (n, NUMBER).

    A row holds the corners of a core in the vehicle's frame, forward and left, the last one
    repeated up to C, and then the radius [units of the field]. C is 1 among discs: the centre.
    """
    flights, fields = buffers.flights, buffers.fields
    most = 1
    if fields.corners.shape[2]:
        each = np.diff(fields.first[np.unique(flights["slot"])], axis=1)
        most = min(max(int(each.max(initial=1)), 1), MOST_CORNERS)
    rows = np.zeros((len(flights), NUMBER, 2 * most + 1), np.float32)
    present = np.zeros((len(flights), NUMBER), np.float32)
    _fill(fields, flights, rows, present)
    return rows, present


def widened(rows: Numbers, corners: int) -> Numbers:
    """Rows (n, m, 2 C + 1) with room for more corners: the last one is repeated."""
    missing = corners - rows.shape[2] // 2
    last = np.tile(rows[:, :, -3:-1], missing)
    return np.concatenate([rows[:, :, :-1], last, rows[:, :, -1:]], axis=2)


@compiled
def _fill(fields: FieldArrays, flights: Records, rows: Numbers, present: Numbers) -> None:
    distance = np.empty(fields.discs.shape[2])
    for i in range(len(flights)):
        flight = flights[i]
        slot = flight.slot
        discs, cores = fields.discs[slot], cores_of(fields, slot)
        unit = fields.records[slot].longest / PAPER_LONGEST
        x, y = flight.position[0], flight.position[1]
        speed = np.sqrt(flight.derivative[0] ** 2 + flight.derivative[1] ** 2)
        cos, sin = flight.derivative[0] / speed, flight.derivative[1] / speed
        at_x, at_y = x + FOCUS * unit * cos, y + FOCUS * unit * sin
        for k in range(discs.shape[1]):  # padding has a radius of minus infinity
            away = np.sqrt((discs[0, k] - at_x) ** 2 + (discs[1, k] - at_y) ** 2) - discs[2, k]
            if away < VIEW * unit and has_core(cores, k):
                away = nearest_outline_point(at_x, at_y, cores, k)[2]
            distance[k] = away if away < VIEW * unit else np.inf
        for j in range(min(NUMBER, len(distance))):
            k = int(distance.argmin())
            if distance[k] == np.inf:
                break
            distance[k] = np.inf
            present[i, j] = 1.0
            row = rows[i, j]
            if has_core(cores, k):
                corners = cores.corners[:, cores.first[k] : cores.first[k + 1]]
                row[-1] = cores.radii[k] / unit
            else:
                corners, row[-1] = discs[:2, k : k + 1], discs[2, k] / unit
            number, most = corners.shape[1], (len(row) - 1) // 2
            first = _first_of_nearest(corners, at_x, at_y, most) if number > most else 0
            for c in range(most):
                corner = (first + min(c, number - 1)) % number
                off_x, off_y = corners[0, corner] - x, corners[1, corner] - y
                row[2 * c] = (cos * off_x + sin * off_y) / unit
                row[2 * c + 1] = (cos * off_y - sin * off_x) / unit


@compiled
def _first_of_nearest(corners: Array, x: float, y: float, most: int) -> int:
    """The first of `most` corners (2, m) that follow each other around the one nearest to a point.

    The run grows by the nearer of the corners before and behind it.
    """
    number = corners.shape[1]
    square = (corners[0] - x) ** 2 + (corners[1] - y) ** 2
    first = last = square.argmin()
    for _ in range(most - 1):
        before, after = (first - 1) % number, (last + 1) % number
        if square[before] < square[after]:
            first = before
        else:
            last = after
    return int(first)
