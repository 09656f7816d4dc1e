"""One step's quadratic program: solved to its optimality conditions, or broken gently."""

from dataclasses import dataclass

import numpy as np
import pytest

from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State, initial_state
from planners.optimization.initial_guesses import straight_ahead
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp import elastic_qp
from planners.optimization.sqp.expansion import empty_expansion, expand
from planners.optimization.sqp.iterate import layout_of
from planners.optimization.sqp.lagrangian import lagrangian
from planners.optimization.sqp.modified_ldl import make_definite
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window
from tests.support.random_windows import Case

ROOM = 512
LIMITS = np.array([PAPER_LIMITS.shortest, PAPER_LIMITS.longest])


@dataclass
class Step:
    """A window's quadratic program at x, and its solution."""

    x: np.ndarray
    box: tuple[np.ndarray, np.ndarray]
    most: np.ndarray
    """Greatest step along each unknown."""
    gradient: np.ndarray
    hessian: np.ndarray
    value: np.ndarray
    """Rows at x: lengths, then contacts."""
    slope: np.ndarray
    contacts: np.ndarray
    """Which of the rows are contacts."""
    p: np.ndarray
    multipliers: np.ndarray

    @property
    def lacks(self) -> tuple[float, float]:
        """What the linearised rows lack in all, before and after the step."""
        return self._lack(self.value), self._lack(self.value + self.slope @ self.p)

    def _lack(self, value: np.ndarray) -> float:
        length, clearance = value[~self.contacts], value[self.contacts]
        short, long = LIMITS[0] - length, length - LIMITS[1]
        return float(np.maximum([*short, *long, *-clearance], 0.0).sum())


def step(window: Window, x: np.ndarray, radius: float, again: bool = False) -> Step:
    layout, m, n = layout_of(window, window.obstacles), len(x), window.chain.segments
    here, program = empty_expansion(n, m, ROOM), elastic_qp.empty_program(n, m, ROOM)
    contacts, _, length, _ = expand(x, layout, elastic_qp.reach(radius), here)
    _, slope, curvature = window.objective.expand(length, here.control[-1, 1])
    gradient, hessian, model = np.empty(m), np.empty((m, m)), np.empty((m, m))
    none = np.zeros(contacts)
    lagrangian(
        layout, here, contacts, slope, curvature, np.zeros(n), none, BENDING, gradient, hessian
    )
    make_definite(hessian, 3e-2, model)
    scale = np.where(np.arange(m) % 4 < 2, 1.0, 3.0)
    p, pulls = np.empty(m), np.zeros(n)
    args = here, contacts, x, *window.box, scale, radius, layout, gradient, model, pulls, none
    assert elastic_qp.solve(*args, program, p)
    found = program.multipliers[: program.number[0]]
    multipliers = np.concatenate([found[:n] - found[n : 2 * n], found[2 * n :]])
    if again:
        # from the rows that are active at the minimum
        carried = np.zeros(contacts)
        carried[program.taken[: len(multipliers) - n]] = multipliers[n:]
        args = *args[:-2], multipliers[:n], carried
        other = np.empty(m)
        assert elastic_qp.solve(*args, program, other)
        np.testing.assert_allclose(other, p, atol=1e-7)
    taken = program.taken[: len(multipliers) - n]
    return Step(
        x=x,
        box=window.box,
        most=radius * scale,
        gradient=gradient,
        hessian=model,
        value=np.concatenate([here.length, here.contact["clearance"][taken]]),
        slope=np.concatenate([here.length_slope, here.slope[taken]]),
        contacts=np.arange(len(multipliers)) >= n,
        p=p,
        multipliers=multipliers,
    )


def assert_within_bounds(step: Step) -> None:
    assert (abs(step.p) <= step.most + 1e-8).all()
    assert (step.x + step.p >= step.box[0] - 1e-8).all()
    assert (step.x + step.p <= step.box[1] + 1e-8).all()


def assert_optimal(step: Step) -> None:
    """The conditions of Karush, Kuhn and Tucker."""
    value, by = step.value + step.slope @ step.p, step.multipliers
    length, clearance = value[~step.contacts], value[step.contacts]
    assert clearance.min(initial=0.0) >= -1e-6
    assert (length >= LIMITS[0] - 1e-6).all()
    assert (length <= LIMITS[1] + 1e-6).all()
    assert (by[step.contacts] >= 0.0).all()
    pulled = by[~step.contacts]
    np.testing.assert_allclose(length[pulled > 1e-9], LIMITS[0], atol=1e-6)
    np.testing.assert_allclose(length[pulled < -1e-9], LIMITS[1], atol=1e-6)
    assert abs(clearance[by[step.contacts] > 1e-9]).max(initial=0.0) <= 1e-6
    rest = step.gradient + step.hessian @ step.p - step.slope.T @ by
    lowest = np.maximum(step.box[0] - step.x, -step.most)
    highest = np.minimum(step.box[1] - step.x, step.most)
    tight = 1e-6 * (1.0 + abs(step.gradient).max())
    assert (rest[step.p > lowest + 1e-7] <= tight).all()
    assert (rest[step.p < highest - 1e-7] >= -tight).all()


@pytest.mark.parametrize("radius", [0.01, 0.5, 2.0, 8.0])
@pytest.mark.parametrize("final", [False, True])
@pytest.mark.parametrize("number", range(1, 5))
def test_steps_in_the_papers_fields_are_optimal(number: int, final: bool, radius: float) -> None:
    field = get_field(f"paper:{number}")
    vehicle = initial_state(field)
    if final:
        vehicle = State(field.goal - [22.0, 20.0], np.array([7.0, 6.0]))
    make = final_window if final else horizon_window
    window = make(field, vehicle, WindowSettings(), 3)
    guess = window.chain.unknowns(straight_ahead(vehicle, 3, PAPER_LIMITS))
    taken = step(window, guess, radius)
    assert_within_bounds(taken)
    before, after = taken.lacks
    if after < 1e-6:
        assert_optimal(taken)
    else:
        assert after < before


def test_steps_from_random_chains_are_optimal_where_rows_are_compatible() -> None:
    optimal = 0
    for seed in range(300):
        window, guess = Case(seed, segments=1 + seed % 4).draw()
        x = np.clip(window.chain.unknowns(guess), *window.box)
        taken = step(window, x, 2.0, again=True)
        assert_within_bounds(taken)
        before, after = taken.lacks
        assert after <= before + 1e-6
        if after < 1e-6:
            assert_optimal(taken)
            optimal += 1
    assert optimal > 100


def test_rows_that_cannot_be_satisfied_are_broken_less() -> None:
    # ten metres inside a disc a step of half a metre does not lead out
    disc = Obstacles.discs([[20.0, 50.0]], [10.0])
    field = Field(name="deep", obstacles=disc, start=[9.0, 50.0], start_derivative=[5.0, 0.0])
    window = horizon_window(field, initial_state(field), WindowSettings(), 3)
    chain = straight_ahead(initial_state(field), 3, PAPER_LIMITS)
    taken = step(window, window.chain.unknowns(chain), 0.5)
    assert_within_bounds(taken)
    before, after = taken.lacks
    assert after > 0.1
    assert after < 0.95 * before


@pytest.mark.parametrize(
    ("end", "goal", "limit"),
    [([1.0, 1.0], [0.3, 0.3], LIMITS[0]), ([11.0, 11.0], [90.0, 90.0], LIMITS[1])],
)
def test_a_length_beyond_its_limits_is_brought_back_to_them(
    end: list[float], goal: list[float], limit: float
) -> None:
    field = Field(
        name="open", obstacles=Obstacles.discs([], []), goal=goal, start_derivative=[1.0, 1.0]
    )
    window = horizon_window(field, initial_state(field), WindowSettings(), 1)
    taken = step(window, np.array([*end, *end]), 2.0)
    assert_optimal(taken)
    assert (taken.value + taken.slope @ taken.p)[0] == pytest.approx(limit, abs=1e-6)
