"""Cached machine code is tied to all source files, since kernels call each other."""

import shutil
from pathlib import Path

import pytest

from ferguson_gym import segments
from ferguson_gym.compilation import PACKAGES, digest

ROOT = Path(__file__).parent.parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for package in PACKAGES:
        (tmp_path / package).mkdir()
        for path in (ROOT / package).glob("*.py"):
            shutil.copy(path, tmp_path / package)
    return tmp_path


def test_every_file_is_watched_since_kernels_take_constants_from_any(copy: Path) -> None:
    before = digest(copy)
    for package in PACKAGES:
        for path in (copy / package).glob("*.py"):
            source = path.read_text()
            path.write_text(f"{source}\n# a change\n")
            assert digest(copy) != before, path.name
            path.write_text(source)
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
