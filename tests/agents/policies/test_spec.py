"""The grammar of policy names: what a name is parsed into, and its canonical form."""

import pytest

from agents.policies.spec import PolicySpec
from ferguson_gym.world import get_field
from planners.registry import PlannerSpec


def test_a_planner_with_all_parts() -> None:
    name = "multi-start+margin=0.5+sensing=20+backtrack+from=guided+turn=3+shield"
    assert PolicySpec.parse(name) == PolicySpec(
        planner=PlannerSpec(name="multi-start", backtrack=True, margin=0.5, sensing=20.0),
        start_from=PolicySpec(planner=PlannerSpec(name="guided", turn=3.0)),
        shield=True,
    )


def test_an_agent_with_all_parts() -> None:
    spec = PolicySpec.parse("runs/mine+tries=16+shield")
    assert spec == PolicySpec(agent="runs/mine", tries=16, shield=True)
    assert not spec.is_planner


def test_an_agent_with_limited_sensing() -> None:
    spec = PolicySpec.parse("runs/mine+tries=16+sensing=45.0+shield")
    assert spec == PolicySpec(agent="runs/mine", tries=16, sensing=45.0, shield=True)
    assert str(spec) == "runs/mine+tries=16+sensing=45+shield"
    with pytest.raises(ValueError, match="a sensing range is a number of metres, got 'far'"):
        PolicySpec.parse("runs/mine+sensing=far")
    with pytest.raises(ValueError, match="at least the longest segment, 15 m"):
        PolicySpec.parse("runs/mine+sensing=9").check(get_field("paper:1"))


def test_the_path_of_an_agent_may_hold_a_plus() -> None:
    assert PolicySpec.parse("runs/a+b") == PolicySpec(agent="runs/a+b")
    assert PolicySpec.parse("runs/a+b+tries=4").agent == "runs/a+b"


@pytest.mark.parametrize(
    ("name", "canonical"),
    [
        ("guided", "guided"),
        ("guided+turn=3.0", "guided+turn=3"),
        ("guided+sensing=20+backtrack", "guided+backtrack+sensing=20"),
        ("multi-start+from=guided+turn=2.50", "multi-start+from=guided+turn=2.5"),
        ("runs/mine+tries=08", "runs/mine+tries=8"),
        ("runs/mine+sensing=45.50", "runs/mine+sensing=45.5"),
        ("single-start+from=runs/mine+tries=2", "single-start+from=runs/mine+tries=2"),
    ],
)
def test_canonical_names(name: str, canonical: str) -> None:
    assert str(PolicySpec.parse(name)) == canonical
    assert PolicySpec.parse(canonical) == PolicySpec.parse(name)


@pytest.mark.parametrize(
    ("name", "agents"),
    [
        ("guided+shield", ()),
        ("runs/mine+tries=4+shield", ("runs/mine",)),
        ("multi-start+from=runs/mine+tries=4", ("runs/mine",)),
        ("multi-start+from=guided", ()),
    ],
)
def test_the_agents_of_a_policy(name: str, agents: tuple[str, ...]) -> None:
    assert PolicySpec.parse(name).agents == agents


def test_a_planner_s_proposer_may_have_the_shield() -> None:
    spec = PolicySpec.parse_planner("single-start+from=runs/mine+shield")
    assert not spec.shield
    assert spec.start_from == PolicySpec(agent="runs/mine", shield=True)


def test_options_are_added_once() -> None:
    spec = PolicySpec.parse_planner("multi-start").with_options(
        backtrack=True, sensing=20.0, turn=None, start_from="guided"
    )
    assert str(spec) == "multi-start+backtrack+sensing=20+from=guided"
    for twice in ({"backtrack": True}, {"sensing": 0.0}, {"start_from": "guided"}):
        with pytest.raises(ValueError, match="carries an option twice"):
            spec.with_options(**twice)
