"""Durations for a given chain."""

import numpy as np
import pytest

from ferguson_gym.vehicles.retiming import duration_ratios, shortest_durations
from ferguson_gym.vehicles.speed_profile import fastest_along
from ferguson_gym.vehicles.timed_segments import rates, velocity
from ferguson_gym.vehicles.vehicle import Vehicle
from ferguson_gym.vehicles.vehicle_names import VEHICLES, get_vehicle
from tests.ferguson_gym.vehicles.test_speed_profile import winding

LINE = [[[0, 0], [9, 0], [9, 0], [9, 0]]]


def test_a_chain_has_one_common_duration() -> None:
    assert duration_ratios(winding(5, 1)).tolist() == [1.0] * 5


def test_ratios_make_velocities_continuous() -> None:
    chain = winding(5, 2)
    scaled = chain.copy()
    # each segment between the same points, with derivatives of its own length
    for k, factor in enumerate((1.0, 1.3, 0.7, 1.0, 1.1)):
        scaled[k, 2:] *= factor
    ratios = duration_ratios(scaled)
    ends = velocity(scaled, ratios, [0.0, 1.0])
    np.testing.assert_allclose(ends[:-1, 1], ends[1:, 0], rtol=1e-12)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=lambda one: one.name)
@pytest.mark.parametrize("seed", range(5))
def test_shortest_durations_touch_a_limit(vehicle: Vehicle, seed: int) -> None:
    chain = winding(4, seed)
    found = shortest_durations(chain, vehicle)
    ratios = rates(chain, found.durations).ratios(vehicle)
    assert ratios[:, 1:].max() == pytest.approx(1.0, rel=1e-6)
    assert found.outcome.success == bool(ratios[:, 0].max() <= 1.0 + 1e-5)
    # free speeds along the same path, from the same first speed, are at least as fast
    first = float(np.linalg.norm(velocity(chain[:1], found.durations[:1], 0.0)))
    if found.outcome.success:
        free = fastest_along(chain, vehicle, first)
        assert free.seconds <= found.seconds * (1.0 + 2e-3)


def test_a_line_is_flown_at_top_speed() -> None:
    found = shortest_durations(LINE, get_vehicle("fixed-wing"))
    assert found.seconds == pytest.approx(9.0 / 15.0)
    assert found.outcome.success


def test_a_chain_too_uneven_for_one_duration_is_reported() -> None:
    uneven = [[[0, 0], [7, 0], [2, 0], [16, 0]]]
    assert shortest_durations(uneven, get_vehicle("fixed-wing")).outcome.label == "too_slow"


def test_chains_that_have_no_durations_are_refused() -> None:
    with pytest.raises(ValueError, match="segments 0 and 1 join with different directions"):
        duration_ratios([LINE[0], [[9, 0], [9, 9], [0, 9], [0, 9]]])
    with pytest.raises(ValueError, match="segments 0 and 1 do not join"):
        duration_ratios([LINE[0], LINE[0]])
    with pytest.raises(ValueError, match="derivative at a joint is zero"):
        duration_ratios([[[0, 0], [9, 0], [9, 0], [0, 0]], [[9, 0], [18, 0], [9, 0], [9, 0]]])
    with pytest.raises(ValueError, match="a chain has shape"):
        duration_ratios(LINE[0])
    with pytest.raises(ValueError, match="a chain that does not move"):
        shortest_durations(np.zeros((1, 4, 2)), get_vehicle("multirotor"))
