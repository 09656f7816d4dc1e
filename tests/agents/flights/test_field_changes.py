"""Changes to fields: what they do, how they are described, and that their JSON form is exact."""

import numpy as np
import pytest

from agents.flights.field_changes import UNCHANGED, FieldChanges
from ferguson_gym.world import get_field

BOTH = FieldChanges(inflate=0.3, limits=(("segments", 60), ("longest", 30)))


def test_obstacles_and_limits_are_changed() -> None:
    field = get_field("paper:2")
    changed = BOTH.apply(field)
    assert changed.obstacles.are_discs
    assert field.obstacles.are_discs
    np.testing.assert_array_equal(changed.obstacles.radii, field.obstacles.radii + 0.3)
    assert changed.limits == field.with_limits(longest=30, segments=60).limits
    assert changed.name == "paper:2"


def test_no_changes_are_false_and_leave_the_field() -> None:
    field = get_field("paper:2")
    assert not UNCHANGED
    assert UNCHANGED.apply(field) is field
    assert str(UNCHANGED) == ""
    assert list(UNCHANGED.words()) == []
    assert UNCHANGED.as_json() == {"inflate": 0.0}


def test_the_order_of_limits_does_not_matter() -> None:
    other = FieldChanges(inflate=0.3, limits=(("longest", 30.0), ("segments", 60.0)))
    assert other == BOTH
    assert hash(other) == hash(BOTH)


def test_descriptions() -> None:
    assert str(BOTH) == "obstacles inflated by 0.3 m, longest 30 m, segments 60"
    assert str(FieldChanges(limits=(("slowest", 0.2),))) == "slowest 0.2 m per unit t"
    exact = FieldChanges(inflate=0.1 + 0.2, limits=(("tolerance", 1e-6),))
    assert list(exact.words()) == ["--inflate", repr(0.1 + 0.2), "--limit", "tolerance=1e-06"]


@pytest.mark.parametrize("changes", [UNCHANGED, BOTH, FieldChanges(inflate=0.1 + 0.2)])
def test_json(changes: FieldChanges) -> None:
    assert FieldChanges.of_json({"other": 1, **changes.as_json()}) == changes


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"inflate": -1}, "obstacles are inflated by 0 m or more, got -1 m"),
        ({"inflate": None}, "inflate must be a number"),
        ({"limits": [30]}, "limits are names with values"),
        ({"limits": {"longest": "30"}}, "limit longest must be a number"),
        ({"limits": {"gaet": 1}}, r"unknown limit 'gaet' \(did you mean 'gate'\?\)"),
    ],
)
def test_malformed_json_is_refused(values: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        FieldChanges.of_json(values)


def test_limits_that_do_not_fit_a_field_are_refused_with_its_name() -> None:
    with pytest.raises(ValueError, match=r"paper:2, with gate 4 m: need 0 <= gate < shortest"):
        FieldChanges(limits=(("gate", 4.0),)).apply(get_field("paper:2"))
