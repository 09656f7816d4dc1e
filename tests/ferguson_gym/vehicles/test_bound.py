"""The lower bound of flight times."""

import numpy as np
import pytest

from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.vehicles.bound import fastest_bound, least_seconds
from ferguson_gym.vehicles.speed_profile import profile
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_names import VEHICLES, get_vehicle
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=lambda one: one.name)
@pytest.mark.parametrize("metres", [0.5, 9.0, 40.0, 150.0])
def test_the_bound_is_the_time_straight_ahead(vehicle: Vehicle, metres: float) -> None:
    # u is linear in the distance until top speed, so that a piece must end there
    run_up = (vehicle.max_speed**2 - vehicle.start_speed**2) / (2.0 * vehicle.max_longitudinal)
    steps = [metres] if metres <= run_up else [run_up, metres - run_up]
    flown = profile(steps, np.zeros(len(steps)), vehicle)
    assert least_seconds(metres, vehicle) == pytest.approx(flown.seconds, rel=1e-12)


def test_limits_without_acceleration_and_no_distance() -> None:
    assert least_seconds(30.0, Vehicle(max_speed=3.0)) == 10.0
    assert least_seconds(0.0, get_vehicle("multirotor"), 0.0) == 0.0
    with pytest.raises(ValueError, match="a distance is at least 0 m"):
        least_seconds(-1.0, get_vehicle("multirotor"))


def test_the_bound_of_a_field_uses_its_exact_length() -> None:
    field, wing = get_field("paper:2"), get_vehicle("fixed-wing")
    path = shortest_path(field)
    assert path is not None
    assert fastest_bound(field, wing) == least_seconds(path.length, wing)
    assert fastest_bound(field, wing, 15.0) == pytest.approx(path.length / 15.0)


def test_a_closed_field_has_no_bound() -> None:
    ring = [[10.0 * np.cos(a), 10.0 * np.sin(a)] for a in np.linspace(0.0, 2.0 * np.pi, 12)]
    closed = Field(name="closed", obstacles=Obstacles.discs(ring, [4.0] * 12), bounds=(-30, 110))
    assert fastest_bound(closed, get_vehicle("fixed-wing")) is None
