"""The shield: flights that arrive with any agent, and a record of how steps were decided."""

import numpy as np
import pytest

from agents.evaluation import summary
from agents.evaluation.tables import shields
from agents.flights.flight import Flight, fly
from agents.flights.flight_table import table_of
from agents.policies.interface import Policy
from agents.policies.registry import make_policy
from agents.policies.shield import PATIENCE, Shield
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.environment import ObstacleField
from ferguson_gym.shortest_paths.distance_to_goal import distance_to_go
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from planners.interface import Decision, Plan, State, WindowReport
from planners.receding_horizon.guided import Guided
from planners.rollout import roll_out
from tests.support.scripted_policies import CIRCLING, COLLIDING, Always, Noisy, Straight

OPEN = Field(name="open", obstacles=Obstacles.discs(np.array([[60.0, 5.0]]), np.array([3.0])))
HEAD_ON = Field(
    name="head-on",
    obstacles=Obstacles.discs(np.array([[17.0, 17.0]]) / np.sqrt(2.0), np.array([5.95])),
)
"""A straight segment of 11 m ends 5 cm in front of a disc, heading for its centre."""
AGENTS = {
    "straight": Straight,
    "noisy": Noisy,
    "very noisy": lambda: Noisy(noise=0.3),
    "circling": lambda: Always(*CIRCLING),
    "colliding": lambda: Always(*COLLIDING),
    "giving up": Always,
}


class Never:
    """A planner that finds nothing."""

    def plan(self, field: Field, state: State, seed: int) -> Plan:
        return roll_out(self, field, state, seed)

    def decide(self, field: Field, state: State, seed: int) -> Decision:
        return Decision(None, WindowReport(step=state.vehicle.segments, seconds=0.0))


def shielded(agent: Policy, field: Field) -> Flight:
    return fly(Shield(agent), field, 0, name="shielded")


def states(flown: Flight) -> list[transition.State]:
    """Before each step, and the last."""
    first = transition.initial_state(flown.field)
    ends = [transition.State(c[1], c[3], k + 1) for k, c in enumerate(flown.control)]
    return [first, *ends]


@pytest.mark.parametrize("agent", AGENTS)
@pytest.mark.parametrize("spec", ["standard/train:0-1", "traps/train:0-1", "town/train:0"])
def test_any_shielded_agent_arrives(agent: str, spec: str) -> None:
    for field in get_fields(spec):
        flown = shielded(AGENTS[agent](), field)
        assert flown.outcome is Outcome.GOAL_REACHED
        assert is_feasible(flown.control, field).all()
        assert len(flown.shield_decisions) == len(flown.decisions) == len(flown.control)
        assert not {ShieldDecision.UNPROVEN, ShieldDecision.STUCK} & set(flown.shield_decisions)


@pytest.mark.parametrize("agent", ["straight", "noisy", "very noisy", "circling"])
def test_from_every_accepted_state_the_planner_arrives(agent: str) -> None:
    field, planner = get_field("standard/train:3"), Guided()
    flown = shielded(AGENTS[agent](), field)
    accepted = [
        s
        for hand, s in zip(flown.shield_decisions, states(flown)[1:], strict=True)
        if hand is ShieldDecision.AGENT
    ]
    assert accepted
    for state in accepted[::3]:
        assert planner.plan(field, State(state), 0).success


def test_an_accepted_flight_is_the_agent_s_own_and_it_acts_once_in_each_state() -> None:
    field = get_field("sparse/train:0")
    alone, under = (fly(name, field, 0) for name in ("guided", "guided+shield"))
    np.testing.assert_array_equal(under.control, alone.control)
    assert set(under.shield_decisions) == {ShieldDecision.AGENT}
    agent = Always(0.0, 0.0, 0.0, 0.0)
    shielded(agent, OPEN)
    asked = [state.segments for state in agent.asked]
    assert asked == sorted(set(asked))


@pytest.mark.parametrize(
    ("agent", "hand"),
    [(Always(), ShieldDecision.GAVE_UP), (Always(*COLLIDING), ShieldDecision.INFEASIBLE)],
)
def test_with_a_useless_agent_the_flight_is_the_planner_s(
    agent: Always, hand: ShieldDecision
) -> None:
    field = get_field("traps/train:0")
    flown = shielded(agent, field)
    np.testing.assert_array_equal(flown.control, fly("guided", field, 0).control)
    assert set(flown.shield_decisions) == {hand}


def test_a_segment_into_a_dead_end_is_replaced() -> None:
    flown = shielded(Straight(), HEAD_ON)
    assert flown.shield_decisions[0] is ShieldDecision.NOT_CONTINUABLE
    assert flown.success


def test_a_circling_agent_is_stopped() -> None:
    flown = shielded(Always(*CIRCLING), OPEN)
    assert ShieldDecision.LOITERING in flown.shield_decisions
    to_go, _ = distance_to_go(OPEN)(np.array([s.position for s in states(flown)]))
    nearest = np.minimum.accumulate(to_go)
    agents = np.array([hand is ShieldDecision.AGENT for hand in flown.shield_decisions])
    assert (agents & (to_go[1:] >= nearest[:-1])).sum() == PATIENCE


def test_short_segments_leave_enough_segments_to_arrive() -> None:
    flown = shielded(Straight(stride=3.2), OPEN)
    assert flown.success
    assert ShieldDecision.RUNNING_OUT in flown.shield_decisions
    assert flown.shield_decisions[0] is ShieldDecision.AGENT
    assert len(flown.control) <= PAPER_LIMITS.segments


def test_a_segment_without_an_alternative_is_flown_and_counted_as_unproven() -> None:
    flown = fly(Shield(Straight(), Never()), HEAD_ON, 0, name="unproven")
    assert flown.shield_decisions == [ShieldDecision.UNPROVEN, ShieldDecision.STUCK]
    assert flown.outcome is Outcome.GAVE_UP
    assert len(flown.control) == 1


def test_after_a_disturbance_the_agent_acts_again() -> None:
    agent = Straight()
    shield, env = Shield(agent), ObstacleField(fields=1)
    seen, _ = env.reset(seed=0, options={"field": OPEN})
    shield.begin(OPEN, 0)
    start = env.state
    shield.act(seen, start)
    elsewhere = transition.State(start.position + np.array([8.0, 7.0]), start.derivative, 1)
    action = shield.act(seen, elsewhere)
    assert action is not None
    np.testing.assert_array_equal(action, agent.act(seen, elsewhere))


def test_shield_decisions_are_summarised_in_a_table() -> None:
    flown = [shielded(Always(*CIRCLING), OPEN), fly("guided", OPEN, 0)]
    told = summary.shields(table_of(flown))
    assert told[0]["steps"] == len(flown[0].shield_decisions)
    table = shields(told, {one["policy"]: "whole field" for one in told})
    assert table is not None
    assert list(map(str, table.columns[0].cells)) == ["whole field:", told[0]["policy"]]
    assert "loitering" in str([*table.columns[-1].cells][1])
    assert shields(summary.shields(table_of(flown[1:])), {}) is None


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("ace+shield", "unknown policy 'ace'"),
        ("shortest+shield", "'shortest' plans its whole path at once"),
        ("guided+shield+shield", "'guided\\+shield' has a shield already"),
    ],
)
def test_shields_that_do_not_fit_are_an_error(name: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make_policy(name)
