"""Cached machine code is tied to every file that kernels reach, since they call each other."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ferguson_gym import segments
from ferguson_gym.compilation import PACKAGES, digest, reachable

ROOT = Path(__file__).parent.parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        for path in (ROOT / package).glob("*.py"):
            shutil.copy(path, tmp_path / package)
    return tmp_path


def test_every_file_that_kernels_reach_is_watched_since_they_take_constants(copy: Path) -> None:
    before, watched = digest(copy), {path.name for path in reachable(copy)}
    for package in PACKAGES:
        for path in (copy / package).glob("*.py"):
            source = path.read_text()
            path.write_text(f"{source}\n# a change\n")
            assert (digest(copy) != before) == (path.name in watched), path.name
            path.write_text(source)
    assert digest(copy) == before


def test_what_a_file_with_kernels_imports_is_reached(copy: Path) -> None:
    """Asked of Python itself: what importing the files with kernels loads."""
    with_kernels = [
        f"{path.parent.name}.{path.stem}"
        for package in PACKAGES
        for path in (copy / package).glob("*.py")
        if "@compiled" in path.read_text()
    ]
    loaded = subprocess.run(
        [
            sys.executable,
            "-c",
            f"import sys, {', '.join(with_kernels)}; print(*sys.modules)",
        ],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split()
    needed = {
        name.split(".")[1] + ".py"
        for name in loaded
        if name.startswith(tuple(f"{package}." for package in PACKAGES))
    }
    assert needed <= {path.name for path in reachable(copy)}


def test_what_no_kernel_reaches_costs_no_compilation(copy: Path) -> None:
    before = digest(copy)
    (copy / "planners" / "new_peer.py").write_text("from planners import distance\n")
    assert digest(copy) == before


def test_packages_are_those_with_kernels() -> None:
    having = {
        path.parent.name
        for path in ROOT.glob("*/*.py")
        if "@compiled" in path.read_text() and path.parent.name != "tests"
    }
    assert having == set(PACKAGES)


def test_machine_code_is_cached_under_the_digest() -> None:
    assert digest(ROOT) in segments.clearance.__qualname__


FLIGHTS = """
import gc
from numba.core.dispatcher import Dispatcher
from agents.flights import fly
from agents.policies import expert
from agents.warm_up import compile_kernels, warm
from ferguson_gym.catalog import one
from planners.catalog import PLANNERS
from tests.quick_planners import quick

def kernels():
    found = [thing for thing in gc.get_objects() if isinstance(thing, Dispatcher)]
    return {(k.py_func.__module__, k.py_func.__name__, *map(str, k.signatures)) for k in found}

fields = [one(name) for name in ("sparse/train:0", "traps/train:0", "paper:1")]
compile_kernels()
for planner in PLANNERS:
    warm(planner)
before = kernels()
for planner in PLANNERS:
    for field in fields:
        fly(expert(quick(planner)), planner, field, 0)
print(sorted(kernels() - before))
"""


def test_no_flight_waits_for_a_kernel() -> None:
    """In a fresh process, where each is compiled, or loaded, when it is first called."""
    done = subprocess.run(
        [sys.executable, "-c", FLIGHTS],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "[]\n"
