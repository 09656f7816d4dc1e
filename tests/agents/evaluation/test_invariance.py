"""Results depend on policy, field and seed alone: agents and planners, whatever flies them."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

from agents.evaluation import run
from agents.evaluation.request import Request
from agents.evaluation.work import WORK
from agents.runtime import executors
from agents.runtime.executors import Backend
from tests.support.processes.dask_cluster import cluster

pytestmark = pytest.mark.slow
FIELDS = [*(f"standard/train:{k}" for k in range(4)), "traps/train:3", "forest/train:0", "paper:4"]
POLICIES = ["best", "dagger-ppo", "best+shield", "guided", "multi-start", "rrt", "shortest"]


def request_of(**changes: int) -> Request:
    return Request(policies=POLICIES, fields=FIELDS, seeds=range(3, 5), **changes)


def arrays(directory: Path) -> dict[str, list[object]]:
    with np.load(directory / "paths.npz") as paths:
        return {name: [paths[name].dtype, paths[name].tobytes()] for name in paths.files}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Flown by this process, as nothing else is said."""
    directory = tmp_path_factory.mktemp("plain")
    run.run(request_of(), directory, Backend())
    return directory


def alike(one: Path, other: Path) -> bool:
    assert not (other / WORK).exists()
    assert arrays(one) == arrays(other)
    assert (one / "paths.npz").read_bytes() == (other / "paths.npz").read_bytes()
    return (one / "flights.csv").read_bytes() == (other / "flights.csv").read_bytes()


@pytest.mark.parametrize(("workers", "chunk"), [(1, 5), (2, 3), (4, 4)])
def test_any_number_of_workers_with_chunks_of_any_size_fly_the_same(
    workers: int, chunk: int, plain: Path, tmp_path: Path
) -> None:
    run.run(request_of(chunk=chunk), tmp_path, Backend(workers=workers))
    assert alike(plain, tmp_path)


@pytest.mark.parametrize("together", [1, 3, 7])
def test_any_number_of_flights_in_the_air_are_the_same(
    together: int, plain: Path, tmp_path: Path
) -> None:
    run.run(request_of(), tmp_path, Backend(workers=2), batch=together)
    assert alike(plain, tmp_path)


def test_a_dask_cluster_of_two_flies_the_same(
    plain: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(executors, "TIMEOUT", 60.0)  # the machine may be busy
    with cluster(tmp_path) as (address, _, worker):
        worker(), worker()
        backend = Backend(name="dask", address=address)
        run.run(request_of(chunk=3), tmp_path / "there", backend, batch=3)
    assert alike(plain, tmp_path / "there")
