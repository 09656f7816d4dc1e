"""Statistics of many plans, against values known in closed form."""

import numpy as np
import pytest
from scipy.stats import binomtest

from agents.flights.metrics import (
    CONFIDENCE,
    best_so_far,
    finite,
    path_share,
    quantile,
    share_within,
    success_interval,
)


@pytest.mark.parametrize(("successes", "number"), [(0, 10), (7, 10), (10, 10), (981, 1000)])
def test_the_interval_solves_wilsons_equation(successes: int, number: int) -> None:
    # its ends are the chances p from which the observed share is 1.96 deviations away
    share, z = successes / number, 1.959963984540054
    for p in success_interval(successes, number):
        if 0.0 < p < 1.0:
            deviation = np.sqrt(p * (1.0 - p) / number)
            assert abs(share - p) / deviation == pytest.approx(z, rel=1e-9)
    low, high = success_interval(successes, number)
    assert 0.0 <= low <= share <= high <= 1.0
    assert high - low > 0.0


@pytest.mark.parametrize(("successes", "number"), [(0, 10), (7, 10), (10, 10), (981, 1000)])
def test_whole_counts_have_the_interval_of_scipy(successes: int, number: int) -> None:
    theirs = binomtest(successes, number).proportion_ci(CONFIDENCE, method="wilson")
    found = success_interval(successes, number)
    np.testing.assert_allclose(found, (theirs.low, theirs.high), atol=1e-15)


def test_a_fraction_of_a_success_lies_between_whole_counts() -> None:
    less, between, more = (success_interval(count, 10) for count in (7, 7.5, 8))
    assert less.low < between.low < more.low
    assert less.high < between.high < more.high


@pytest.mark.parametrize(("successes", "number"), [(0, 0), (3, 2), (-1, 2)])
def test_impossible_counts_are_refused(successes: int, number: int) -> None:
    with pytest.raises(ValueError, match=f"got {successes} successes of {number}"):
        success_interval(successes, number)


def test_the_best_length_is_a_step_function_of_time() -> None:
    progress = [(0.5, 180.0), (1.0, 160.0), (4.0, 150.0)]
    at = [0.0, 0.4999, 0.5, 0.99, 1.0, 3.9, 4.0, 100.0]
    expected = [np.inf, np.inf, 180.0, 180.0, 160.0, 160.0, 150.0, 150.0]
    np.testing.assert_array_equal(best_so_far(progress, at), expected)
    np.testing.assert_array_equal(best_so_far([], [0.0, 1.0]), [np.inf, np.inf])


def test_a_longer_route_found_later_is_not_the_best() -> None:
    np.testing.assert_array_equal(
        best_so_far([(1.0, 150.0), (2.0, 170.0), (3.0, 140.0)], [1.5, 2.5, 3.5]),
        [150.0, 150.0, 140.0],
    )


def test_a_profile_counts_failures_as_never() -> None:
    gaps = [0.3, None, 0.1, 0.1]
    levels = [0.0, 0.1, 0.2, 0.3, np.inf]
    np.testing.assert_array_equal(share_within(gaps, levels), [0.0, 0.5, 0.5, 0.75, 0.75])
    np.testing.assert_array_equal(share_within([], [1.0]), [0.0])


def test_a_quantile_is_the_least_value_that_the_share_does_not_exceed() -> None:
    values = [4.0, np.inf, 1.0, 3.0, 2.0]
    assert quantile(values, 0.5) == 3.0
    assert quantile(values, 0.8) == 4.0
    assert quantile(values, 0.81) == np.inf
    assert quantile([1.0, np.inf], 0.5) == 1.0
    assert quantile([], 0.5) is None


def test_a_flight_counts_in_spl_if_it_arrived_and_the_shortest_path_is_known() -> None:
    assert float(path_share(True, 150.0, 144.0)) == 0.96
    assert float(path_share(True, 143.0, 144.0)) == 1.0
    assert float(path_share(False, 20.0, 144.0)) == 0.0
    assert float(path_share(True, 150.0, None)) == 0.0
    shares = path_share([True, True, False], [150.0, 150.0, 9.0], [144.0, np.nan, 144.0])
    np.testing.assert_array_equal(shares, [0.96, 0.0, 0.0])


def test_what_is_infinite_or_missing_is_none() -> None:
    assert [finite(value) for value in (1.5, np.inf, np.nan, None)] == [1.5, None, None, None]
