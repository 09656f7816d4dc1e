"""Planners with options among buildings and walls."""

import numpy as np
import pytest

from ferguson_gym.curves.arc_length import length
from ferguson_gym.world.feasibility import is_feasible
from ferguson_gym.world.field_names import get_field
from planners.interface import initial_state
from planners.registry import make
from planners.whole_path.polish import polish


@pytest.mark.parametrize(
    "name", ["guided+margin=0.3", "guided+sensing=20", "multi-start+backtrack", "guided+turn=3"]
)
@pytest.mark.parametrize("field", ["town/train:0", "walls/train:1"])
def test_they_arrive(name: str, field: str) -> None:
    some = get_field(field)
    plan = make(name).plan(some, initial_state(some), 0)
    assert plan.success
    assert is_feasible(plan.control, some).all()


def test_a_margin_is_kept_from_walls_where_there_is_room() -> None:
    field = get_field("town/train:0")
    plan = make("guided+margin=0.3").plan(field, initial_state(field), 0)
    clear = field.obstacles.clearance(plan.control)
    assert np.median(clear) > 0.29


def test_a_flight_between_buildings_is_polished() -> None:
    field = get_field("town/train:0")
    flight = make("pursuit").plan(field, initial_state(field), 0).control
    shorter = polish(flight, field)
    assert is_feasible(shorter, field).all()
    assert length(shorter).sum() < 0.995 * length(flight).sum()
