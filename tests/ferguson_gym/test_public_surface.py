"""What the package offers at its root, and what importing it costs."""

import subprocess
import sys
from importlib import import_module

import pytest

import ferguson_gym

NAMES = {
    "": (
        "ObstacleField VectorObstacleField Field Obstacles Limits Outcome Vehicle get_field "
        "get_fields get_vehicle"
    ),
    ".curves": "evaluate derivative length clearance Path PathSamples",
    ".shortest_paths": "shortest_path exact_length gap DistanceToGoal",
}

IMPORT = """
import sys, time
import gymnasium
began = time.perf_counter()
import ferguson_gym
print(time.perf_counter() - began)
print(*(name for name in ("numba", "scipy", "torch", "matplotlib") if name in sys.modules))
"""


@pytest.mark.parametrize("folder", NAMES)
def test_public_names_can_be_imported_from_their_folder(folder: str) -> None:
    module = import_module(f"ferguson_gym{folder}")
    for name in NAMES[folder].split():
        assert getattr(module, name).__module__.startswith(f"ferguson_gym{folder}."), name
        assert name in dir(module)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="'ferguson_gym' has no attribute 'Fields'"):
        getattr(ferguson_gym, "Fields")  # noqa: B009 (mypy refuses the attribute)


def test_importing_the_package_is_quick_and_loads_no_compiler_torch_or_matplotlib() -> None:
    """The shortest of three times, since another process may hold the processor."""
    answers = [
        subprocess.run(
            [sys.executable, "-c", IMPORT], capture_output=True, text=True, check=True
        ).stdout.splitlines()
        for _ in range(3)
    ]
    assert min(float(seconds) for seconds, _ in answers) < 0.1
    assert {loaded for _, loaded in answers} == {""}
