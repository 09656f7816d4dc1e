"""The program's objective is that of the chain to second order, and its rows prove clearance."""

import numpy as np
import pytest

from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.convex.obstacle_rows import Surroundings
from planners.optimization.convex.program import Terminal, assemble
from planners.optimization.convex.rows import Program, Weights, place_of, unknowns
from planners.optimization.convex.solver import Caps, Solution, solve
from planners.optimization.quadrature import bending, lengths

BOUNDS = np.array([[-50.0, -50.0], [150.0, 150.0]])
OPEN = Terminal(False, 0.8, 0.6, 0.05)


def chain(seed: int, segments: int) -> np.ndarray:
    """A smooth chain of segments of about 6 m."""
    stream = np.random.default_rng(seed)
    headings = np.cumsum(stream.normal(size=segments + 1) * 0.3)
    slopes = 6.0 * np.stack([np.cos(headings), np.sin(headings)], axis=1)
    knots = np.concatenate([[[0.0, 0.0]], np.cumsum(0.5 * (slopes[1:] + slopes[:-1]), axis=0)])
    return np.stack([knots[:-1], knots[1:], slopes[:-1], slopes[1:]], axis=1)


def around(obstacles: Obstacles) -> Surroundings:
    centers, radii = obstacles.balls
    corners = np.ascontiguousarray(obstacles.points.T)
    columns = np.ascontiguousarray(centers.T)
    return Surroundings(columns, radii, corners, obstacles.starts, obstacles.radii)


def written(
    control: np.ndarray, terminal: Terminal, obstacles: Obstacles, weights: Weights | None = None
) -> Program:
    fits, program = assemble(
        control,
        terminal,
        3,
        BOUNDS,
        around(obstacles),
        3.0,
        weights or Weights(),
        2000,
    )
    assert fits
    return program


def solved(control: np.ndarray, obstacles: Obstacles, weights: Weights) -> Solution:
    return solve(control, OPEN, 3, BOUNDS, around(obstacles), 3.0, weights, Caps(2000, 500))


def changed(control: np.ndarray, change: np.ndarray, final: bool) -> np.ndarray:
    """The chain with changes of its unknowns."""
    result, n = control.copy(), len(control)
    for k in range(n):
        for a in range(4):
            for d in range(2):
                if (place := place_of(k, a, d, n, final)) >= 0:
                    result[k, a, d] += change[place]
    return result


@pytest.mark.parametrize("final", [False, True])
@pytest.mark.parametrize("segments", [1, 3])
def test_the_objective_to_second_order(segments: int, final: bool) -> None:
    weights = Weights(damping=0.0, bending=1e-3)
    terminal = Terminal(True, 0.0, 0.0, 0.0) if final else OPEN
    nothing = Obstacles.discs(np.empty((0, 2)), [])
    control = chain(segments, segments)
    program = written(control, terminal, nothing, weights)
    m = unknowns(segments, final)
    assert program.gradient.shape == (m,)
    ux, uy = OPEN.ux, OPEN.uy

    def objective(x: np.ndarray) -> float:
        there = changed(control, x, final)
        moved = there[-1, 1] - control[-1, 1]
        across = moved @ [-uy, ux]
        togo = 0.0 if final else -moved @ [ux, uy] + 0.5 * OPEN.bend * across**2
        return float(lengths(there).sum() + 1e-3 * bending(there) + togo)

    stream, step = np.random.default_rng(3), 1e-3
    for _ in range(5):
        x = stream.normal(size=m)
        up, here, down = (objective(h * step * x) for h in (1.0, 0.0, -1.0))
        # four Gauss nodes against 32
        assert (up - down) / (2.0 * step) == pytest.approx(program.gradient @ x, abs=2e-3)
        assert (up - 2.0 * here + down) / step**2 == pytest.approx(
            x @ program.hessian @ x, rel=0.02, abs=2e-3
        )


def scattered(seed: int) -> Obstacles:
    """Obstacles of every shape beside a chain that leads through them."""
    stream = np.random.default_rng(seed)
    middles = stream.uniform(-4.0, 22.0, (12, 1, 2))
    parts = [
        Obstacles.polygons(list(middles[:4] + stream.normal(size=(4, 3, 2)) * 1.5), 0.2),
        Obstacles.capsules(middles[4:8] + stream.normal(size=(4, 2, 2)) * 2.0, 0.4),
        Obstacles.discs(middles[8:, 0], stream.uniform(0.3, 2.0, 4)),
    ]
    every = Obstacles.joined(parts)
    return every.only(every.signed_distance(np.zeros(2)) > 0.5)


def test_what_keeps_all_rows_is_clear_of_the_obstacles_that_have_rows() -> None:
    number = 0
    for seed in range(60):
        control, obstacles = chain(seed, 3), scattered(seed)
        wide = Weights(reach=100.0)
        found = solved(control, obstacles, wide)
        if not found.found:
            continue
        number += 1
        assert obstacles.clearance(found.control).min() > 0.0
    assert number > 20


def test_too_many_rows_are_reported() -> None:
    arguments = (3, BOUNDS, around(scattered(0)), 3.0, Weights(reach=100.0))
    assert not assemble(chain(0, 3), OPEN, *arguments, 40)[0]


def test_an_infeasible_program_has_no_solution() -> None:
    # from in front of a wall, at right angles to it, no chain of long chords leads anywhere
    wall = Obstacles.boxes([[0.5, -40.0]], [[60.0, 40.0]])
    control = chain(0, 2)
    found = solved(control, wall, Weights())
    assert found.rows > 0
    assert not found.found
    np.testing.assert_array_equal(found.control, control)


def test_rows_are_the_entries_of_their_segments_unknowns() -> None:
    control = chain(1, 3)
    program = written(control, OPEN, scattered(1), Weights(reach=100.0))
    assert program.rows.shape[1] == 8
    assert set(program.offsets[24:].tolist()) == {0, 4}
    first = program.rows[24]  # the chord of the first segment: its end alone can change
    assert (first[2:] == 0.0).all()
    assert np.linalg.norm(first[:2]) == pytest.approx(1.0)


def test_parts_are_halved_where_normals_turn_far() -> None:
    corner = Obstacles.boxes([[3.0, 0.5]], [[30.0, 30.0]])
    around_it = np.array([[[0.0, 0.0], [6.0, 0.0], [6.0, 0.0], [6.0, 0.0]]])
    whole, halved = (
        len(written(around_it, OPEN, corner, Weights(halvings=most)).rows) for most in (0, 4)
    )
    assert halved > whole
