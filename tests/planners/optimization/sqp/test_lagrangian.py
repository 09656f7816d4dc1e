"""Derivatives of an expanded chain and of the Lagrangian, against central differences."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings

from ferguson_gym.curves.splines import derivative
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.optimization.sqp.contacts import LOW, SPEED
from planners.optimization.sqp.elastic_qp import empty_program
from planners.optimization.sqp.lagrangian import warm_start_multipliers
from planners.optimization.window import Window, WindowSettings, horizon_window
from tests.support.expanded_windows import (
    Expanded,
    expanded,
    ordinary,
    windows,
)


def differences(
    here: Expanded, function: Callable[[Expanded], np.ndarray], step: float, **layout: object
) -> np.ndarray | None:
    """Central differences (..., unknowns); None where a contact comes or goes."""
    columns = []
    for along in step * np.eye(len(here.x)):
        sides = [expanded(here.window, here.x + way, **layout) for way in (along, -along)]
        if not all(np.array_equal(side.things, here.things) for side in sides):
            return None
        columns.append((function(sides[0]) - function(sides[1])) / (2.0 * step))
    return np.stack(columns, axis=-1)


def values(here: Expanded) -> np.ndarray:
    """Of lengths, contacts and objective."""
    f = here.window.objective.value(here.length, here.out.control[-1, 1]) + here.bent
    return np.concatenate([here.out.length, here.contact["clearance"], [f]])


@pytest.mark.parametrize("bending_weight", [0.0, 0.01])
@given(windows)
@settings(deadline=None, max_examples=100, derandomize=True)
def test_slopes_of_lengths_clearances_and_objective_agree_with_differences(
    bending_weight: float, drawn: tuple[Window, np.ndarray]
) -> None:
    window, x = drawn
    pinned = np.array([[0.0, 0.0, 0.6]]) if len(window.obstacles) else np.empty((0, 3))
    here = expanded(window, x, pinned_contacts=pinned, bending_weight=bending_weight)
    expected = differences(
        here, values, 1e-6, pinned_contacts=pinned, bending_weight=bending_weight
    )
    assume(expected is not None)
    gradient, _ = here.gradient_and_hessian(np.zeros(len(here.out.length)), np.zeros(here.count))
    got = np.vstack([here.out.length_slope, here.slope, gradient])
    np.testing.assert_allclose(got, expected, atol=1e-5)


CURVED = {
    "objective": None,
    "bending": None,
    "lengths": None,
    "a disc": lambda c: (c["what"] >= 0) & (c["drift"] > 0.0),
    "the end and a disc": lambda c: (c["what"] >= 0) & (c["t"] == 1.0),
    "along a disc": lambda c: (c["what"] >= 0) & (c["drift"] == 0.0) & (c["t"] < 1.0),
    "least speed": lambda c: (c["what"] == SPEED) & (c["drift"] > 0.0),
    "speed at a joint": lambda c: (c["what"] == SPEED) & (c["drift"] == 0.0),
    "bounds": lambda c: c["what"] <= LOW,
}


def hessian_agrees(here: Expanded, tension: np.ndarray, multiplier: np.ndarray) -> bool:
    """Asserts it; False where a contact comes or goes."""
    bending_weight = here.layout.bending_weight
    expected = differences(
        here,
        lambda there: there.gradient_and_hessian(tension, multiplier)[0],
        1e-5,
        bending_weight=bending_weight,
    )
    if expected is None:
        return False
    _, hessian = here.gradient_and_hessian(tension, multiplier)
    size = abs(expected).max()
    np.testing.assert_allclose(hessian, expected, atol=1e-5 * (1.0 + size))
    np.testing.assert_allclose(hessian, hessian.T, atol=1e-13 * size)
    return True


@pytest.mark.parametrize("final", [False, True])
@pytest.mark.parametrize("part", CURVED)
def test_the_lagrangians_hessian_agrees_with_differences_of_its_gradient(
    part: str, final: bool
) -> None:
    checked = 0
    for seed in range(1000):
        window, x = ordinary(seed, final=final)
        here = expanded(window, x, bending_weight=0.02 if part == "bending" else 0.0)
        tension, multiplier = np.zeros(3), np.zeros(here.count)
        if part == "lengths":
            tension[:] = 2.0, -3.0, 0.7
        elif CURVED[part] is not None:
            # where a minimum is all but flat, it moves too fast for differences
            chosen = CURVED[part](here.contact) & (here.contact["drift"] < 1.0)
            multiplier[chosen] = np.random.default_rng(seed).uniform(0.5, 2.0, chosen.sum())
            if not chosen.any():
                continue
        speed = np.linalg.norm(derivative(here.out.control, np.linspace(0.0, 1.0, 101)), axis=-1)
        if speed.min() > 0.5 and hessian_agrees(here, tension, multiplier):
            checked += 1
        if checked == 8:
            return
    pytest.fail(f"only {checked} chains found")


@pytest.mark.parametrize("across", [False, True])
def test_a_multiplier_follows_its_contact_across_a_joint(across: bool) -> None:
    """The tip of a triangle beside a straight chain, whose joint moves past it."""
    tip = Obstacles.polygons([[[10.0, 0.5], [8.0, -5.0], [12.0, -5.0]]])
    field = Field(name="tip", obstacles=tip, start=[0.0, 1.0], goal=[40.0, 0.0])
    along = np.array([9.8, 0.0])
    window = horizon_window(field, State(field.start, along), WindowSettings(), 2)

    def chain(joint: float) -> Expanded:
        return expanded(window, np.concatenate([[joint, 1.0], along, [2.0 * joint, 1.0], along]))

    old, new = chain(9.8), chain(10.2)
    (before,), (after,) = (
        np.flatnonzero((here.contact["what"] == 0) & (here.contact["drift"] != 0.0))
        for here in (old, new)
    )
    assert old.contact["segment"][before] != new.contact["segment"][after]
    tension, carried = np.empty(2), np.empty(len(new.out.contact))
    program = empty_program(2, 8, 1)
    program.multipliers[:], program.number[0], program.taken[0] = [0, 0, 0, 0, 3], 5, before
    given = new.out, new.count, across, tension, carried
    warm_start_multipliers(old.out, program, *given)
    assert carried[: new.count].sum() == (3.0 if across else 0.0)
    assert carried[after] == (3.0 if across else 0.0)
