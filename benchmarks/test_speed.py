"""Times of what users wait for, by pytest-benchmark.

Run it from a checkout with the extras `bench` and `dev`: `.venv/bin/pytest benchmarks`. Compare two
commits with `--benchmark-save NAME` and `--benchmark-compare NAME`. It is not among the tests that
`make test` runs.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from agents.flights.flight import fly
from agents.policies.registry import make_policy
from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.clearance import clearance
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.world.field_names import get_field
from planners.interface import initial_state
from planners.registry import make

pytest.importorskip("pytest_benchmark")
Timer = Callable[..., Any]
SEGMENTS = 2000


@pytest.fixture(scope="module")
def segments() -> Array:
    """Random segments of the size of a flight's: (2000, 4, 2)."""
    stream = np.random.default_rng(0)
    start = stream.uniform(0.0, 100.0, (SEGMENTS, 2))
    end = start + stream.uniform(-10.0, 10.0, (SEGMENTS, 2))
    return np.stack([start, end, *stream.uniform(-12.0, 12.0, (2, SEGMENTS, 2))], axis=1)


def test_certified_clearance(benchmark: Timer, segments: Array) -> None:
    discs = get_field("paper:1").obstacles
    found = benchmark(clearance, segments, discs.centers, discs.radii)
    assert np.isfinite(found).all()


def test_arc_length(benchmark: Timer, segments: Array) -> None:
    assert (benchmark(length, segments) > 0.0).all()


def test_exact_shortest_path(benchmark: Timer) -> None:
    path = benchmark(shortest_path, get_field("paper:1"))
    assert path.length == pytest.approx(144.8458, abs=1e-4)


@pytest.mark.parametrize("name", ["multi-start", "guided", "pursuit"])
def test_decision(benchmark: Timer, name: str) -> None:
    planner, field = make(name), get_field("paper:1")
    assert benchmark(planner.decide, field, initial_state(field), 0).chain is not None


@pytest.mark.parametrize("name", ["shortest", "guided", "best", "dagger-ppo"])
def test_flight(benchmark: Timer, name: str) -> None:
    policy, field = make_policy(name), get_field("paper:1")
    assert benchmark(fly, policy, field).length > 140.0
