"""Blocked cells as rectangles: exactly covered, and without a way between neighbours."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ferguson_gym.importers.grid_rectangles import overlapping, rectangles
from ferguson_gym.world.obstacles import Obstacles

GRIDS = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(
    lambda shape: st.lists(
        st.booleans(), min_size=shape[0] * shape[1], max_size=shape[0] * shape[1]
    ).map(lambda cells: np.array(cells).reshape(shape))
)


@settings(deadline=None)
@given(GRIDS)
def test_rectangles_cover_exactly_the_blocked_cells_and_do_not_overlap(blocked):
    times = np.zeros(blocked.shape, int)
    for left, top, right, end in rectangles(blocked):
        times[top:end, left:right] += 1
    np.testing.assert_array_equal(times, blocked.astype(int))


@settings(deadline=None)
@given(GRIDS)
def test_overlapping_rectangles_cover_the_same_cells_and_every_side_between_two(blocked):
    low, high = overlapping(blocked)
    inside = Obstacles.boxes(low, high)
    rows, columns = np.mgrid[: blocked.shape[0], : blocked.shape[1]]
    for x, y in ((0.5, 0.5), (0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)):
        points = np.stack([columns + x, rows + y], axis=-1)
        within = (inside.signed_distance(points) < 0.0).any(axis=-1)
        np.testing.assert_array_equal(within, blocked)
    # the sides of blocked cells that are the border
    ends = {(0.5, 0.0): (rows == 0), (0.0, 0.5): (columns == 0)}
    ends |= {(0.5, 1.0): rows == len(blocked) - 1, (1.0, 0.5): columns == blocked.shape[1] - 1}
    for (x, y), at_border in ends.items():
        points = np.stack([columns + x, rows + y], axis=-1)[blocked & at_border]
        assert (inside.signed_distance(points) < 0.0).any(axis=-1).all()
    # points on the side between two blocked cells
    beside = {(0.5, 1.0): blocked[:-1] & blocked[1:], (1.0, 0.5): blocked[:, :-1] & blocked[:, 1:]}
    for (x, y), both in beside.items():
        row, column = np.nonzero(both)
        points = np.stack([column + x, row + y], axis=-1)
        assert (inside.signed_distance(points) < 0.0).any(axis=-1).all()


@pytest.mark.parametrize(
    ("rows", "number"), [(["..", ".."], 0), (["@@", "@@"], 1), (["@.", "@@"], 2)]
)
def test_runs_are_joined_over_rows(rows, number):
    blocked = np.array([[cell == "@" for cell in row] for row in rows])
    assert len(rectangles(blocked)) == number
    assert len(overlapping(blocked)[0]) == number
