"""Cached machine code is tied to every file that kernels reach, since they call each other."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ferguson_gym.curves import certified_kernels
from ferguson_gym.runtime.jit import PACKAGES, digest, reachable
from tests.support.places import ROOT

COMPILED = reachable.__module__
COMPILER = f"{COMPILED.replace('.', '/')}.py"


def sources(root: Path) -> list[Path]:
    """Of the packages, without the files that make folders packages."""
    return [
        path
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
        if path.name != "__init__.py"
    ]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            place = tmp_path / path.relative_to(ROOT)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)
    return tmp_path


def test_every_file_that_kernels_reach_is_watched_since_they_take_constants(copy: Path) -> None:
    before, watched = digest(copy), set(reachable(copy))
    for path in sources(copy):
        source = path.read_text()
        path.write_text(f"{source}\n# a change\n")
        assert (digest(copy) != before) == (path in watched), path
        path.write_text(source)
    assert digest(copy) == before


def test_what_a_file_with_kernels_imports_is_reached(copy: Path) -> None:
    """Asked of Python itself: what importing the files with kernels loads."""
    with_kernels = [
        ".".join(path.relative_to(copy).with_suffix("").parts)
        for path in sources(copy)
        if "@compiled" in path.read_text()
    ]
    # a package's own file would import modules that kernels do not reach through it
    for path in copy.rglob("__init__.py"):
        path.write_text("")
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
    modules = {copy / f"{name.replace('.', '/')}.py" for name in loaded}
    assert len(modules & set(sources(copy))) > len(with_kernels)
    assert modules & set(sources(copy)) <= set(reachable(copy))


@pytest.fixture
def small(tmp_path: Path) -> Path:
    """A tree with nothing but the compiler."""
    (tmp_path / COMPILER).parent.mkdir(parents=True)
    (tmp_path / COMPILER).touch()
    return tmp_path


def reached(root: Path) -> set[str]:
    return {path.relative_to(root).as_posix() for path in reachable(root)} - {COMPILER}


def test_a_name_that_a_package_exports_leads_to_the_module_that_defines_it(small: Path) -> None:
    room = small / "planners" / "room"
    room.mkdir(parents=True)
    (room / "__init__.py").write_text("from planners.room.inner import (\n    thing as thing,\n)\n")
    (room / "inner.py").write_text("thing = 1\n")
    (room / "apart.py").write_text("other = 1\n")
    (small / "planners" / "kernels.py").write_text(
        f"from {COMPILED} import compiled\nfrom planners.room import thing  # one\n"
    )
    names = {"planners/kernels.py", "planners/room/__init__.py", "planners/room/inner.py"}
    assert reached(small) == names


def test_modules_of_one_name_in_two_folders_are_told_apart(small: Path) -> None:
    for folder in ("planners/near", "planners/far"):
        (small / folder).mkdir(parents=True)
        (small / folder / "same.py").write_text("value = 1\n")
    (small / "planners" / "kernels.py").write_text(
        f"from {COMPILED} import compiled\nfrom planners.near import same\n"
    )
    assert reached(small) == {"planners/kernels.py", "planners/near/same.py"}


def test_what_no_kernel_reaches_costs_no_compilation(copy: Path) -> None:
    before = digest(copy)
    source = "from ferguson_gym.shortest_paths import exact\n"
    (copy / "planners" / "new_peer.py").write_text(source)
    assert digest(copy) == before


def test_packages_are_those_with_kernels() -> None:
    having = {
        path.relative_to(ROOT).parts[0]
        for path in ROOT.rglob("*.py")
        if not path.relative_to(ROOT).parts[0].startswith((".", "tests"))
        and "@compiled" in path.read_text()
    }
    assert having == set(PACKAGES)


def test_machine_code_is_cached_under_the_digest() -> None:
    assert digest(ROOT) in certified_kernels.clearance.__qualname__


FLIGHTS = """
import gc
from numba.core.dispatcher import Dispatcher
from agents.flights.flight import fly
from agents.policies.planner_policies import planner_policy
from agents.policies.warm_up import warm
from agents.runtime.kernels import compile_kernels
from ferguson_gym.world.field_names import get_field
from planners.registry import PLANNERS
from tests.support.quick_planners import quick

def kernels():
    found = [thing for thing in gc.get_objects() if isinstance(thing, Dispatcher)]
    return {(k.py_func.__module__, k.py_func.__name__, *map(str, k.signatures)) for k in found}

fields = [get_field(name) for name in ("sparse/train:0", "traps/train:0", "paper:1")]
compile_kernels()
for planner in PLANNERS:
    warm(planner)
before = kernels()
for planner in PLANNERS:
    for field in fields:
        fly(planner_policy(quick(planner)), field)
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
