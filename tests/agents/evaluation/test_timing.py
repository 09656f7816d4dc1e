"""Decisions are timed one policy at a time, on flights spread over all."""

import numpy as np
import pytest

from agents.evaluation import timing as evaluation_timing
from agents.evaluation.request import Request
from agents.evaluation.timing import MOST, measure


def request_of(count: int) -> Request:
    return Request(
        policies=["pursuit", "shortest"],
        fields=[f"sparse/train:{k}" for k in range(count)],
        seeds=[0],
    )


def test_all_flights_of_a_fast_policy_are_timed_and_every_decision() -> None:
    timing = measure(request_of(3), "pursuit", budget=60.0)
    assert len(timing.flights) == 3
    assert len(timing.decisions) >= 3 * 10  # a flight has that many segments
    told = timing.summary()
    assert 0.0 < told["decision_seconds_median"] <= told["decision_seconds_99"]
    assert told["flight_seconds_median"] > told["decision_seconds_median"]


def test_no_flight_is_begun_when_the_time_is_up_but_one_is_flown() -> None:
    timing = measure(request_of(3), "pursuit", budget=0.0)
    assert len(timing.flights) == 1


@pytest.mark.parametrize("number", [1, 2, 3, 19, 20, 21, 1000, 12345])
def test_timed_flights_are_spread_evenly_whenever_time_is_up(number: int) -> None:
    order = evaluation_timing._spread(number, MOST)
    assert len(order) == len(set(order)) == min(number, MOST)
    assert min(order) >= 0
    assert max(order) < number
    if number > MOST:
        apart = np.diff(np.sort(order))
        assert apart.max() - apart.min() <= 1
        # after the first few, none lies in one half alone
        assert min(order[:4]) < number / 2 < max(order[:4])
