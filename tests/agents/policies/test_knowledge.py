"""What policies say that they know of a field, and that it is true."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from agents.flights import fly
from agents.models.model_card import ModelCard
from agents.policies.knowledge import HEADINGS, grouped, label_by_name, labels
from agents.policies.registry import make_policy
from agents.policies.shield import Shield
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import initial_state
from planners import PLANNERS, make, register
from planners.interface import Knowledge, Planner, knowledge_of
from planners.receding_horizon.pursuit import Pursuit
from tests.support.quick_planners import quick

NEAR = [[12.0, 4.0], [3.0, 14.0]]
"""Centres of discs that any policy sees from the start."""
FAR = [72.0, 70.0]
"""Centre of a disc on the straight line to the goal, farther away than any range: the shortest path
bends around it from the start on."""
OPEN = Field(name="open", obstacles=Obstacles.discs(NEAR, [3.0, 3.0]))
CLOSED = Field(name="closed", obstacles=Obstacles.discs([*NEAR, FAR], [3.0, 3.0, 20.0]))


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    with patch.dict(PLANNERS):
        yield


@pytest.mark.parametrize("name", PLANNERS)
def test_of_the_planners_the_papers_alone_see_what_is_nearby(name: str) -> None:
    nearby = name in ("single-start", "multi-start")
    assert knowledge_of(quick(name)) is (Knowledge.NEARBY if nearby else Knowledge.WHOLE_FIELD)


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("guided+turn=3", "whole field"),
        ("guided+margin=0.5", "whole field"),
        ("guided+sensing=20", "nearby"),
        ("guided+margin=0.5+sensing=20", "nearby"),
        ("multi-start+margin=0.5", "nearby"),
        ("multi-start+backtrack", "whole field"),
        ("multi-start+backtrack+sensing=20", "nearby"),
        ("multi-start+from=pursuit", "whole field"),
        ("multi-start+from=dagger", "nearby"),
        ("multi-start+from=best", "whole field"),
        ("multi-start+sensing=20+from=best", "nearby"),
        ("dagger", "nearby"),
        ("dagger-ppo", "nearby"),
        ("dagger+tries=2", "whole field"),
        ("best", "whole field"),
        ("dagger+shield", "whole field"),
        ("single-start+shield", "whole field"),
        ("guided+sensing=20+shield", "whole field"),
        ("runs/mine", None),
        ("guided+sensing=far", None),
        ("multi-start+from=" * 5000 + "guided", None),
    ],
)
def test_options_and_wrappers_change_what_a_policy_knows(name: str, label: str | None) -> None:
    assert label_by_name(name) == label


def first_action(name: str, field: Field) -> Action:
    policy = make_policy(name)
    policy.begin(field, 0)
    action = policy.act({}, initial_state(field))
    assert action is not None
    return action


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("single-start", True),
        ("multi-start", True),
        ("multi-start+margin=0.5", True),
        ("multi-start+from=dagger", True),
        ("multi-start+sensing=20+from=best", True),
        ("guided+sensing=20", True),
        ("pursuit+sensing=20", True),
        ("dagger-ppo", True),
        ("guided", False),
        ("pursuit", False),
        ("shortest", False),
        ("multi-start+from=pursuit", False),
        ("best", False),
    ],
)
def test_a_distant_obstacle_changes_the_flight_of_those_alone_that_know_it(
    name: str, same: bool
) -> None:
    assert np.array_equal(first_action(name, OPEN), first_action(name, CLOSED)) == same
    assert label_by_name(name) == ("nearby" if same else "whole field")


@pytest.mark.parametrize("name", ["single-start", "multi-start", "guided+sensing=20"])
def test_windows_that_end_on_the_goal_see_no_more(name: str) -> None:
    goal, near = np.array([34.0, 20.0]), [*NEAR, [22.0, 20.0]]
    far = [[100.0, 95.0], [95.0, 10.0], [20.0, 85.0]]
    discs = (
        Obstacles.discs(near, [3.0, 3.0, 4.0]),
        Obstacles.discs([*near, *far], [3.0, 3.0, 4.0, 10.0, 9.0, 8.0]),
    )
    fields = [Field(name=str(k), obstacles=one, goal=goal) for k, one in enumerate(discs)]
    first, second = (fly(name, field) for field in fields)
    assert first.success
    assert any(decision.report.final for decision in first.decisions)
    np.testing.assert_array_equal(first.control, second.control)


def test_a_shield_knows_the_whole_field_whatever_decides() -> None:
    assert knowledge_of(Shield(make_policy("dagger"), make("guided+sensing=20"))) is (  # type: ignore[arg-type]
        Knowledge.WHOLE_FIELD
    )


@pytest.mark.parametrize(
    ("environment", "nearby"), [({}, True), ({"way": 0}, True), ({"way": 3}, False)]
)
def test_a_network_that_observes_the_shortest_path_knows_the_whole_field(
    environment: dict[str, Any], nearby: bool
) -> None:
    card = ModelCard(algorithm="ppo", policy="mlp", policy_kwargs={}, environment=environment)
    assert card.knows is (Knowledge.NEARBY if nearby else Knowledge.WHOLE_FIELD)


class Silent(Pursuit):
    """A planner that inherits what it says."""


@dataclass(frozen=True)
class Near:
    """A planner that sees what is nearby."""

    knows = Knowledge.NEARBY

    def plan(self, *_: object) -> Any:
        raise NotImplementedError


@dataclass(frozen=True)
class Wrong(Near):
    """A planner that says it in its own words."""

    knows = "a little"  # type: ignore[assignment]


@dataclass(frozen=True)
class Unsaid:
    """A planner of another package, which says nothing."""

    plan = Near.plan


@pytest.mark.parametrize(
    ("planner", "label"), [(Near, "nearby"), (Unsaid, "whole field"), (Silent, "whole field")]
)
def test_registered_planners_say_what_they_know(planner: type[Planner], label: str) -> None:
    register("mine", planner)
    assert label_by_name("mine") == label


def test_a_wrong_statement_is_refused_before_anything_is_flown() -> None:
    register("mine", Wrong)
    with pytest.raises(ValueError, match=r"knows of a Wrong must be Knowledge\.WHOLE_FIELD or"):
        make("mine")
    assert label_by_name("mine") is None


def test_what_is_recorded_goes_before_names_unless_it_is_malformed() -> None:
    names = ["guided", "runs/mine", "single-start", "best"]
    recorded = {"guided": "nearby", "runs/mine": "nearby", "single-start": ["nearby"], "best": "x"}
    assert labels(names, recorded) == {
        "guided": "nearby",
        "runs/mine": "nearby",
        "single-start": "nearby",
        "best": "whole field",
    }


def test_groups_are_in_one_order_and_leave_none_out() -> None:
    rows = [("a", "nearby"), ("b", None), ("c", "whole field"), ("d", "nearby")]
    found = grouped(rows, lambda row: row[1])
    assert [(heading, [name for name, _ in group]) for heading, group in found] == [
        ("whole field", ["c"]),
        ("nearby", ["a", "d"]),
        ("?", ["b"]),
    ]
    assert [heading for heading, _ in found] == list(HEADINGS)
    assert grouped([], str) == []
