"""Cached machine code is tied to every file that kernels reach, since they call each other."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ferguson_gym.curves import obstacle_kernels
from ferguson_gym.runtime import jit
from ferguson_gym.runtime.jit import PACKAGES, Sources
from tests.support.places import ROOT


def sources(root: Path) -> dict[str, Path]:
    """Modules of the packages by dotted names, without the files that make folders packages."""
    return {
        ".".join(path.relative_to(root).with_suffix("").parts): path
        for package in PACKAGES
        for path in (root / package).rglob("*.py")
        if path.name != "__init__.py"
    }


def with_kernels(root: Path) -> list[str]:
    return [name for name, path in sources(root).items() if "@compiled" in path.read_text()]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            place = tmp_path / path.relative_to(ROOT)
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, place)
    return tmp_path


def test_every_file_that_kernels_reach_is_watched_since_they_take_constants(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parse, parsed = Sources._imported, {}

    def parse_once(self: Sources, source: str) -> set[str]:
        """No file comes or goes here, so that a text imports the same whenever it is read."""
        if source not in parsed:
            parsed[source] = parse(self, source)
        return parsed[source]

    monkeypatch.setattr(Sources, "_imported", parse_once)
    kernels = with_kernels(copy)
    found = Sources(copy)
    before = {name: (found.digest(name), found.reachable(name)) for name in kernels}
    for changed, path in sources(copy).items():
        source = path.read_text()
        path.write_text(f"{source}\n# a change\n")
        now = Sources(copy)
        for name in kernels:
            digest, reached = before[name]
            assert (now.digest(name) != digest) == (changed in reached), (changed, name)
        path.write_text(source)


def test_what_a_file_with_kernels_imports_is_reached(copy: Path) -> None:
    """Asked of Python itself: what importing a file with kernels loads."""
    # a package's own file would import modules that kernels do not reach through it
    for path in copy.rglob("__init__.py"):
        path.write_text("")
    program = (
        "import importlib, sys\n"
        f"for name in {with_kernels(copy)!r}:\n"
        f"    for old in [old for old in sys.modules if old.partition('.')[0] in {PACKAGES!r}]:\n"
        "        del sys.modules[old]\n"
        "    importlib.import_module(name)\n"
        "    print(name, *sys.modules)\n"
    )
    told = subprocess.run(
        [sys.executable, "-c", program],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    found, known = Sources(copy), set(sources(copy))
    assert len(told) == len(with_kernels(copy))
    for name, *loaded in map(str.split, told):
        assert {name} < known.intersection(loaded) <= found.reachable(name), name


def write(root: Path, **files: str) -> None:
    """Write modules of package planners, given by names with __ for dots."""
    for name, source in files.items():
        path = (root / "planners" / name.replace("__", "/")).with_suffix(".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(source)


def test_a_name_that_a_package_exports_leads_to_the_module_that_defines_it(tmp_path: Path) -> None:
    write(
        tmp_path,
        kernels="from planners.room import thing  # one\n",
        room__inner="thing = 1\n",
        room__apart="other = 1\n",
    )
    exports = "from planners.room.inner import (\n    thing as thing,\n)\n"
    (tmp_path / "planners/room/__init__.py").write_text(exports)
    names = {"planners.kernels", "planners.room", "planners.room.inner"}
    assert Sources(tmp_path).reachable("planners.kernels") == names


def test_modules_of_one_name_in_two_folders_are_told_apart(tmp_path: Path) -> None:
    write(
        tmp_path,
        kernels="import numpy\nfrom planners.near import same\n",
        near__same="value = 1\n",
        far__same="value = 1\n",
    )
    assert Sources(tmp_path).reachable("planners.kernels") == {
        "planners.kernels",
        "planners.near.same",
    }


def test_modules_that_import_each_other_are_both_reached(tmp_path: Path) -> None:
    write(tmp_path, one="from planners import other\n", other="import planners.one\n")
    found = Sources(tmp_path)
    assert found.reachable("planners.one") == found.reachable("planners.other")
    assert found.digest("planners.one") == found.digest("planners.other")


def test_packages_are_those_with_kernels() -> None:
    having = {
        path.relative_to(ROOT).parts[0]
        for path in ROOT.rglob("*.py")
        if not path.relative_to(ROOT).parts[0].startswith((".", "tests"))
        and "@compiled" in path.read_text()
    }
    assert having == set(PACKAGES)


def test_machine_code_is_cached_under_the_digest() -> None:
    digest = Sources(ROOT).digest(obstacle_kernels.__name__)
    assert digest in obstacle_kernels.clearance.__qualname__
    assert jit.__name__ in Sources(ROOT).reachable(obstacle_kernels.__name__)


FLIGHTS = """
import gc
from numba.core.dispatcher import Dispatcher
from agents.flights.flight import fly
from agents.policies.planner_policies import planner_policy
from agents.policies.warm_up import warm
from agents.runtime.kernels import compile_kernels
from ferguson_gym.world.field_names import get_field
from tests.support.quick_planners import installed, quick

def kernels():
    found = [thing for thing in gc.get_objects() if isinstance(thing, Dispatcher)]
    return {(k.py_func.__module__, k.py_func.__name__, *map(str, k.signatures)) for k in found}

names = "sparse/train:0", "traps/train:0", "paper:1", "town/train:2", "walls/train:1"
fields = [get_field(name) for name in names]
compile_kernels()
for planner in installed():
    warm(planner)
before = kernels()
for planner in installed():
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
