"""Backtracking: when it leads, where it leads, how many more flights arrive."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from planners.interface import Decision, Plan, State, Status, WindowReport, initial_state
from planners.receding_horizon.guided import Guided
from planners.registry import PlannerSpec, make
from planners.rollout import roll_out
from planners.wrappers.backtracking import Backtracking, segments_without_progress

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
GUIDED = ("class", "convex", "extended")
"""How the names of starts begin that only `Guided` has."""


@dataclass(frozen=True, slots=True)
class Stuck:
    """Finds no way on from anywhere."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        return Decision(None, WindowReport(step=state.vehicle.segments, seconds=0.0))


def visiting(*points: tuple[float, float]) -> State:
    """The state after flying straight from each point to the next."""
    knots = np.array(points)
    steps = np.diff(knots, axis=0)
    flown = np.stack([knots[:-1], knots[1:], steps, steps], axis=1)
    return State(transition.State(knots[-1], steps[-1], len(steps)), flown=flown)


def test_progress_counts_segments_since_the_nearest_place() -> None:
    assert segments_without_progress(OPEN, initial_state(OPEN)) == 0
    assert segments_without_progress(OPEN, visiting((0, 0), (9, 9), (18, 18))) == 0
    assert (
        segments_without_progress(OPEN, visiting((0, 0), (9, 9), (18, 18), (9, 18), (8, 18))) == 2
    )
    assert (
        segments_without_progress(OPEN, visiting((0, 0), (9, 9), (18, 18), (9, 18), (19, 18))) == 0
    )


@pytest.mark.parametrize("name", ["multi-start", "single-start"])
def test_without_a_dead_end_nothing_changes(name: str) -> None:
    field = get_field("sparse/train:2")
    plan = make(name).plan(field, initial_state(field), 0)
    again = make(f"{name}+backtrack").plan(field, initial_state(field), 0)
    np.testing.assert_array_equal(again.control, plan.control)


def test_the_paper_s_planner_is_led_out_of_a_pocket() -> None:
    field = get_field("traps/train:0")
    plain = make("multi-start").plan(field, initial_state(field), 0)
    assert plain.status is Status.OUT_OF_SEGMENTS
    planner = make("multi-start+backtrack")
    plan = planner.plan(field, initial_state(field), 0)
    assert plan.success
    guided = [decision.report.start.startswith(GUIDED) for decision in plan.decisions]
    waited = [segments_without_progress(field, state) for state in plan.states[: len(guided)]]
    assert any(guided)
    assert not guided[0]
    # the guide leads where the planner is stuck, and only there
    for leads, count in zip(guided, waited, strict=True):
        assert not leads or count >= 3
    # from some states on the way, with and without a guide
    some = {*range(1, len(guided), 6), guided.index(True)}
    assert len({guided[flown] for flown in some}) == 2
    for flown in some:
        again = planner.plan(field, plan.states[flown], 0)
        np.testing.assert_array_equal(again.control, plan.control[flown:])


def test_it_flies_back_if_planner_and_guide_fail() -> None:
    state = visiting((20, 20), (30, 30), (38, 38))
    wall = Obstacles.discs([[44.0, 44.0]], [6.0])  # 2.5 m ahead
    field = Field(name="wall", obstacles=wall)
    decision = Backtracking(planner=Stuck(), guide=Stuck()).decide(field, state, 0)
    assert decision.chain is not None
    assert decision.report.start == "back"
    assert is_feasible(decision.chain, field).all()
    np.testing.assert_array_equal(decision.chain[0, 0], state.vehicle.position)
    assert np.linalg.norm(decision.chain[-1, 1] - state.flown[-1, 0]) < 3.0


def test_without_a_path_flown_there_is_no_way_back() -> None:
    plan = Backtracking(planner=Stuck(), guide=Stuck()).plan(OPEN, initial_state(OPEN), 0)
    assert plan.status is Status.STUCK


def test_a_planner_without_a_way_on_is_replaced_by_its_guide() -> None:
    planner = Backtracking(planner=Stuck(), guide=Guided())
    plan = planner.plan(OPEN, initial_state(OPEN), 0)
    np.testing.assert_array_equal(plan.control, Guided().plan(OPEN, initial_state(OPEN), 0).control)


def test_impatience_is_refused() -> None:
    with pytest.raises(ValueError, match="patience is at least 1 segment, got 0"):
        Backtracking(planner=Stuck(), guide=Guided(), patience=0)


def test_names_carry_options() -> None:
    guided = PlannerSpec(name="guided")
    assert str(guided) == "guided"
    assert str(guided.with_options(backtrack=True, sensing=20.0)) == "guided+backtrack+sensing=20"
    assert str(guided.with_options(turn=2.5)) == "guided+turn=2.5"
    assert make("guided+turn=2.5") == replace(make("guided"), min_turn_radius=2.5)
    assert repr(make("guided+sensing=20+backtrack")) == repr(make("guided+backtrack+sensing=20"))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("shortest+sensing=20", "'shortest' plans its whole path at once and has no option"),
        ("voronoi+backtrack", "'voronoi' plans its whole path at once and has no option"),
        ("guided+sensing=far", "a sensing range is a number of metres, got 'far'"),
        ("guided+sensing", "a sensing range is a number of metres, got ''"),
        ("guided+sensing=-14", "a sensing range must be above 0 m, got -14 m"),
        ("guided+wings", "unknown option 'wings' of planner 'guided'; need NAME"),
        ("guided+backtrack=3", "unknown option 'backtrack=3'"),
        ("guided+backtrack+backtrack", "carries an option twice"),
        ("guided+turn=2+sensing=20", "leave one out"),
        ("multi-start+turn=2", "keeps no turn radius; guided does"),
        ("guided+turn=wide", "a turn radius is a number of metres, got 'wide'"),
        ("guided+turn=0", "turn radius"),
        ("ace+backtrack", "unknown planner 'ace'; planners are single-start"),
    ],
)
def test_options_that_cannot_be_are_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(name)


@pytest.mark.slow
@pytest.mark.parametrize("suite", ["standard", "traps"])
def test_the_paper_s_planner_arrives_with_it(suite: str) -> None:
    planner = make("multi-start+backtrack")
    fields = get_fields(f"{suite}/train:0-99")
    assert sum(planner.plan(field, initial_state(field), 0).success for field in fields) >= 99
