"""Goals that no flight reaches are reported alike, whatever the planner."""

from dataclasses import replace

import numpy as np
import pytest

import planners
from ferguson_gym.world import Field, Limits, Obstacles
from planners import Status, reachability
from planners.interface import initial_state
from planners.reachability import explained, start_hint, unreachable_plan

ANGLES = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
CIRCLE = 50.0 + 30.0 * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
RING = Field(
    name="ring", obstacles=Obstacles.discs(CIRCLE, np.full(40, 3.0)), start=np.array([50.0, 50.0])
)
EMPTY = Obstacles.discs(np.empty((0, 2)), np.empty(0))


def straight(distance: float) -> Field:
    """An empty field with the goal straight ahead, and 40 segments."""
    goal, bounds = np.array([distance, 0.0]), np.array([-10.0, distance + 10.0])
    limits = Limits(segments=40)
    return Field(name="far", obstacles=EMPTY, goal=goal, bounds=bounds, limits=limits)


@pytest.mark.parametrize("name", ["single-start", "pursuit", "shortest"])
def test_a_closed_ring_has_no_way_for_any_planner(name: str) -> None:
    plan = planners.plan(RING, name)
    assert plan.status is Status.NO_WAY
    assert plan.status.sentence == "no way to the goal exists"


def test_an_open_ring_has_a_way() -> None:
    assert RING.obstacles.are_discs
    keep = np.arange(40) > 2
    field = replace(RING, obstacles=RING.obstacles.only(keep))
    assert unreachable_plan(field) is None
    assert planners.plan(field).success
    # a failure on the way stays the planner's own
    stuck = planners.plan(field, "single-start")
    assert explained(stuck, field) is stuck


def test_a_goal_beyond_all_segments_is_reported_before_planning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert unreachable_plan(straight(600.0)) is None
    plan = unreachable_plan(straight(601.0))
    assert plan is not None
    assert (plan.status, len(plan.control), len(plan.states)) == (Status.TOO_FAR, 0, 1)
    assert plan.reason == ("the shortest path is 601 m, and 40 segments of at most 15 m fly 600 m")
    monkeypatch.setattr(reachability, "exact_length", pytest.fail)
    plan = planners.plan(straight(601.0), "multi-start")
    assert plan.status is Status.TOO_FAR
    assert plan.reason.startswith("the straight distance to the goal is 601 m, and 40 segments")


def test_a_detour_beyond_all_segments_explains_a_failure() -> None:
    # a wall between start and goal that leaves only a long way around
    centers = np.column_stack([np.full(16, 5.0), np.arange(-40.0, 120.0, 10.0)])
    wall = Obstacles.discs(centers, np.full(16, 7.0))
    field = Field(
        name="wall",
        obstacles=wall,
        start=np.array([-20.0, 0.0]),
        goal=np.array([30.0, 0.0]),
        bounds=np.array([[-40.0, -40.0], [50.0, 140.0]]),
        limits=Limits(segments=12),
    )
    assert unreachable_plan(field, exact=False) is None
    plan = unreachable_plan(field)
    assert plan is not None
    assert plan.status is Status.TOO_FAR
    assert planners.plan(field, "pursuit").status is Status.TOO_FAR


def test_a_start_that_heads_into_a_disc_is_named() -> None:
    discs = Obstacles.discs([[-9.0, 0.0], [3.0, 0.0]], [9.0, 3.0])
    goal, bounds = np.array([50.0, 0.0]), np.array([-60.0, 60.0])
    field = Field(name="touch", obstacles=discs, goal=goal, bounds=bounds)
    assert start_hint(field).startswith("the start touches obstacle 1, and the start derivative")
    assert not planners.plan(field).success
    away = replace(field, start_derivative=np.array([0.0, 5.0]))
    assert start_hint(away) == ""
    assert planners.plan(away).success
    assert start_hint(straight(100.0)) == ""
    assert len(initial_state(field).tail) == 0


def test_a_start_close_to_an_obstacle_ahead_gets_a_hint() -> None:
    ahead = Obstacles.discs([[1.0, 1.0]], [np.sqrt(2.0) - 0.2])
    hint = start_hint(Field(name="close", obstacles=ahead))
    assert hint.startswith(
        "obstacle 0 is 0.2 m from the start, and the start derivative heads into"
    )
    aside = Obstacles.discs([[1.0, -1.0]], [np.sqrt(2.0) - 0.2])
    assert start_hint(Field(name="aside", obstacles=aside)) == ""
    farther = Obstacles.discs([[2.0, 2.0]], [2.0 * np.sqrt(2.0) - 0.5])
    assert start_hint(Field(name="farther", obstacles=farther)) == ""
