"""Starts from a policy's proposals: polished and certified, and harmless where they fail."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from agents.cli.main import main
from agents.policies.policy_proposals import PolicyProposer
from agents.policies.registry import make_planner, make_policy
from agents.policies.spec import PolicySpec
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import transition
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from planners.constructors import multi_start, single_start
from planners.interface import State, initial_state
from planners.receding_horizon.paper import RecedingHorizon
from planners.registry import make
from planners.wrappers.backtracking import Backtracking
from planners.wrappers.limited_sensing import Sensing
from tests.support.scripted_policies import Always, Noisy, Straight

FIELD = get_field("standard/train:0")
NEAR = Field(
    name="near", obstacles=Obstacles.discs([[10.0, 12.0]], [4.0]), goal=np.array([20.0, 15.0])
)


@dataclass(frozen=True)
class Fixed:
    """Proposes the same chains in every state."""

    chains: Sequence[Array]

    def propose(
        self, field: Field, state: transition.State, segments: int, seed: int
    ) -> Sequence[Array]:
        return self.chains


def noisy(planner: RecedingHorizon) -> RecedingHorizon:
    return replace(planner, proposer=PolicyProposer(Noisy()))


def test_a_proposal_is_the_policy_s_flight() -> None:
    plan = make("guided").plan(FIELD, initial_state(FIELD), 0)
    proposals = PolicyProposer(make_policy("guided"))
    (chain,) = proposals.propose(FIELD, transition.initial_state(FIELD), 3, 0)
    np.testing.assert_array_equal(chain, plan.control[:3])
    (chain,) = proposals.propose(FIELD, plan.states[-2].vehicle, 3, 0)
    np.testing.assert_array_equal(chain[-1, 1], FIELD.goal)


def test_proposals_ignore_obstacles_and_may_be_empty() -> None:
    wall = Field(name="wall", obstacles=Obstacles.discs([[12.0, 12.0]], [6.0]))
    (chain,) = PolicyProposer(Straight()).propose(wall, transition.initial_state(wall), 3, 0)
    assert len(chain) == 3
    np.testing.assert_array_equal(chain[1:, (0, 2)], chain[:-1, (1, 3)])
    assert not is_feasible(chain, wall).any()
    assert PolicyProposer(Always()).propose(wall, transition.initial_state(wall), 3, 0) == []


@pytest.mark.parametrize("planner", [single_start, multi_start])
def test_a_good_proposal_is_the_only_start_and_flights_arrive(planner) -> None:
    for field in (FIELD, get_field("traps/train:0")):
        plan = noisy(planner()).plan(field, initial_state(field), 0)
        assert plan.success
        assert is_feasible(plan.control, field).all()
        starts = [decision.report.starts for decision in plan.decisions]
        assert np.mean(starts) <= 1.5
        plain = multi_start().plan(field, initial_state(field), 0)
        assert plan.evaluations < 0.5 * plain.evaluations


@pytest.mark.parametrize("planner", [single_start, multi_start])
def test_without_a_proposal_or_with_a_hopeless_one_the_decision_is_the_plain_one(planner) -> None:
    state = initial_state(FIELD)
    plain = planner().decide(FIELD, state, 0)
    none = replace(planner(), proposer=Fixed([])).decide(FIELD, state, 0)
    np.testing.assert_array_equal(none.chain, plain.chain)

    class Hopeless:
        def solve(self, window, guesses, until=np.inf):
            return [replace(end, feasible=False) for end in solver.solve(window, guesses, until)]

    solver = planner().polish
    proposer = Fixed([np.array([[[0.0, 0.0], [5.0, 5.0], [3.0, 3.0], [3.0, 3.0]]])])
    failing = replace(planner(), proposer=proposer, polish=Hopeless())
    decision = failing.decide(FIELD, state, 0)
    np.testing.assert_array_equal(decision.chain, plain.chain)
    assert decision.report.start == plain.report.start
    assert decision.report.starts == plain.report.starts + 1


def test_a_proposal_that_ends_on_the_goal_is_polished_to_end_there() -> None:
    planner = replace(multi_start(), proposer=PolicyProposer(Straight()))
    decision = planner.decide(NEAR, initial_state(NEAR), 0)
    assert decision.report.start == "proposal 1"
    assert decision.report.final
    assert decision.report.starts == 1
    assert decision.chain is not None
    assert len(decision.chain) == 3
    np.testing.assert_array_equal(decision.chain[-1, 1], NEAR.goal)
    assert is_feasible(decision.chain, NEAR).all()


def test_replanning_in_the_middle_gives_the_rest_of_the_flight() -> None:
    planner = noisy(multi_start())
    plan = planner.plan(FIELD, initial_state(FIELD), 3)
    rest = planner.plan(FIELD, plan.states[4], 3)
    np.testing.assert_array_equal(rest.control, plan.control[4:])


def test_options_reach_the_planner_inside() -> None:
    spec = PolicySpec.parse("single-start+backtrack+sensing=20+from=guided+turn=3")
    planner = make_planner(spec)
    assert isinstance(planner, Sensing)
    assert isinstance(planner.planner, Backtracking)
    inner = planner.planner.planner
    assert isinstance(inner, RecedingHorizon)
    assert inner.proposer is not None
    assert planner.plan(FIELD, State(transition.initial_state(FIELD)), 0).success


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("guided+from=guided", "'guided' takes no starts from an agent; single-start and multi"),
        ("shortest+from=guided", "'shortest' takes no starts from an agent"),
        ("multi-start+from=ace", "unknown policy 'ace'"),
        ("multi-start+from=", "unknown policy ''"),
    ],
)
def test_proposers_that_do_not_fit_are_an_error(name: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make_policy(name)


def test_plan_starts_from_a_policy_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["plan", "standard/train:0", "--planner", "single-start", "--json"]
    assert main([*command, "--start-from", "guided"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["planner"] == "single-start+from=guided"
    assert report["success"]
    assert main([*command, "--start-from", "ace"]) == 2
    assert "unknown policy 'ace'" in capsys.readouterr().err
