"""Windows and their first guesses."""

import numpy as np
import pytest

from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from planners.optimization.initial_guesses import random_chains, shifted, straight_ahead
from planners.optimization.window import WindowSettings, final_window, horizon_window

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))


def test_the_final_problem_counts_every_obstacle_the_window_only_near_ones() -> None:
    field = get_field("paper:1")
    vehicle = transition.initial_state(field)
    near = horizon_window(field, vehicle, WindowSettings(), 3).sampled()
    every = final_window(field, vehicle, WindowSettings(), 3).sampled()
    within = int((field.obstacles.signed_distance(field.start) <= 45.0).sum())
    assert 0 < within < 50
    guess = straight_ahead(vehicle, 3, PAPER_LIMITS)
    assert len(near.c(near.chain.unknowns(guess))) == 6 + 3 * 29 * within
    assert len(every.c(every.chain.unknowns(guess))) == 6 + 3 * 29 * 50


@pytest.mark.parametrize("number", range(1, 5))
def test_a_window_admits_what_the_sampled_program_does(number: int) -> None:
    field = get_field(f"paper:{number}")
    vehicle = transition.initial_state(field)
    window = horizon_window(field, vehicle, WindowSettings(), 3)
    chains = random_chains(np.random.default_rng(0), vehicle, 3, PAPER_LIMITS, 1000)
    problem, (low, high) = window.sampled(), window.box
    unknowns = [window.chain.unknowns(chain) for chain in chains]
    expected = [
        bool(problem.c(x).min() >= 0.0 and (x >= low).all() and (x <= high).all()) for x in unknowns
    ]
    assert 0 < sum(expected) < 1000
    np.testing.assert_array_equal(window.admits(chains), expected)


def test_shifted_plan_repeats_the_last_point_and_derivative() -> None:
    vehicle = transition.initial_state(OPEN)
    chain = straight_ahead(vehicle, 3, PAPER_LIMITS)
    guess = shifted(transition.State(chain[0, 1], chain[0, 3], 1), chain[1:], 3)
    np.testing.assert_array_equal(guess[:2], chain[1:])
    np.testing.assert_array_equal(guess[2], chain[2][[1, 1, 3, 3]])


def test_random_chains_keep_to_the_step_radii_and_join() -> None:
    vehicle = transition.initial_state(OPEN)
    stream = np.random.default_rng(0)
    chains = random_chains(stream, vehicle, 3, PAPER_LIMITS, 200)
    assert chains.shape == (200, 3, 4, 2)
    chords = np.linalg.norm(chains[:, :, 1] - chains[:, :, 0], axis=-1)
    assert chords.min() >= 3.0
    assert chords.max() <= 15.0
    assert chords.min() < 3.5
    assert chords.max() > 14.5
    np.testing.assert_array_equal(chains[:, 1:, (0, 2)], chains[:, :-1, (1, 3)])
    assert (chains[:, 0, 2] == vehicle.derivative).all()
