"""A plan in one call, from the names of a field and of a planner."""

from pathlib import Path

import numpy as np
import pytest

from ferguson_gym.world.field import to_json
from ferguson_gym.world.field_names import get_field
from planners import make, plan
from planners.interface import initial_state


def test_a_plan_by_names_is_that_of_the_planner_in_the_field(tmp_path: Path) -> None:
    field = get_field("sparse/train:0")
    expected = make("multi-start").plan(field, initial_state(field), 3).control
    file = tmp_path / "own.json"
    to_json(field, file)
    for given in ("sparse/train:0", field, str(file)):
        for planner in ("multi-start", make("multi-start")):
            np.testing.assert_array_equal(plan(given, planner, seed=3).control, expected)


def test_guided_plans_by_default() -> None:
    np.testing.assert_array_equal(
        plan("sparse/train:0").control, plan("sparse/train:0", "guided").control
    )


@pytest.mark.parametrize(
    ("given", "planner", "message"),
    [
        ("paper:9", "guided", "the paper has fields 1 to 4, not 9"),
        ("paper:1", "giuded", r"unknown planner 'giuded' \(did you mean 'guided'\?\)"),
        (9, "guided", "a field must be a Field or the name of one, got int"),
    ],
)
def test_unknown_names_are_refused(given: str, planner: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        plan(given, planner)
