"""The dual active-set method: against DAQP, infeasible programs, dependent rows and the cap."""

from __future__ import annotations

import daqp
import numpy as np
import pytest

from planners.optimization.active_set import CAPPED, INFEASIBLE, SOLVED, minimise


def _random_program(seed, infeasible):
    rng = np.random.default_rng(seed)
    unknowns, number = int(rng.integers(2, 20)), int(rng.integers(1, 150))
    rows = rng.normal(size=(number, unknowns))
    rows[: number // 4] = rows[number // 4 : 2 * (number // 4)]  # rows that depend on each other
    root = rng.normal(size=(unknowns, unknowns))
    hessian = root @ root.T + 1e-3 * np.eye(unknowns)
    slack = rng.random(number) * rng.choice([0.0, 0.1, 1.0])
    least = rows @ rng.normal(size=unknowns) - slack
    if infeasible:
        rows, least = np.vstack([rows, -rows[:1]]), np.append(least, 1e-3 - least[0])
    return hessian, rng.normal(size=unknowns), rows, np.zeros(len(rows), np.int64), least


@pytest.mark.parametrize("seed", range(60))
def test_the_minimum_is_that_of_daqp(seed):
    hessian, gradient, rows, offsets, least = _random_program(seed, infeasible=False)
    x = np.empty(len(gradient))
    status, _ = minimise(hessian, gradient, rows, offsets, least, x, 1000)
    far, sense = np.full(len(least), 1e30), np.zeros(len(least), np.int32)
    expected, *_ = daqp.solve(hessian, gradient, rows, far, least, sense, primal_tol=1e-10)
    assert status == SOLVED
    assert (rows @ x >= least - 1e-8).all()
    value, best = (0.5 * v @ hessian @ v + gradient @ v for v in (x, expected))
    assert value == pytest.approx(best, rel=1e-7, abs=1e-7)


@pytest.mark.parametrize("seed", range(20))
def test_a_program_without_a_feasible_point_is_recognised(seed):
    hessian, gradient, rows, offsets, least = _random_program(seed, infeasible=True)
    assert minimise(hessian, gradient, rows, offsets, least, gradient.copy(), 1000)[0] == INFEASIBLE


def test_the_cap_is_kept():
    hessian, gradient, rows, offsets, least = _random_program(3, infeasible=False)
    x = np.empty(len(gradient))
    status, needed = minimise(hessian, gradient, rows, offsets, least, x, 1000)
    assert status == SOLVED
    assert needed > 1
    assert minimise(hessian, gradient, rows, offsets, least, x, needed - 1) == (CAPPED, needed - 1)


def test_an_indefinite_hessian_is_not_minimised():
    rows, none = np.empty((0, 2)), np.empty(0)
    found = minimise(-np.eye(2), np.ones(2), rows, none.astype(np.int64), none, np.empty(2), 10)
    assert found == (CAPPED, 0)


def test_rows_may_be_given_by_their_entries_that_are_not_zero():
    hessian, gradient, _, _, _ = _random_program(7, infeasible=False)
    m, rng = len(gradient), np.random.default_rng(1)
    entries, offsets = rng.normal(size=(30, 2)), rng.integers(0, m - 1, 30)
    dense = np.zeros((30, m))
    for row, part, offset in zip(dense, entries, offsets, strict=True):
        row[offset : offset + 2] = part
    least, ones = dense @ rng.normal(size=m), np.zeros(30, np.int64)
    short, long = np.empty(m), np.empty(m)
    assert minimise(hessian, gradient, entries, offsets, least, short, 99)[0] == SOLVED
    assert minimise(hessian, gradient, dense, ones, least, long, 99)[0] == SOLVED
    np.testing.assert_allclose(short, long, atol=1e-9)
