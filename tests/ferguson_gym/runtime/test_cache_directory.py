"""Where the package and home cannot be written, as in containers, kernels are cached elsewhere."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from ferguson_gym.runtime import cache_directory
from ferguson_gym.runtime.compilation import COMPILING
from ferguson_gym.runtime.jit import PACKAGES
from tests.support.places import ROOT
from tests.support.processes import other_user

KERNEL = """
from ferguson_gym.runtime.jit import compiled

@compiled
def double(x):
    return 2.0 * x
"""
RUN = (
    "from planners.small_kernel import double\n"
    "print(double(4.0), double.stats.cache_path, sum(double.stats.cache_hits.values()))"
)


def slow(value: str) -> ParameterSet:
    """A value that only `make test-slow` tries."""
    return pytest.param(value, marks=pytest.mark.slow)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The packages in a place that cannot be written, with one kernel that compiles fast."""
    root = tmp_path_factory.mktemp("site-packages")
    for package in PACKAGES:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, root / package, ignore=ignored)
    (root / "planners" / "small_kernel.py").write_text(KERNEL)
    folders = [root, *(path for path in root.rglob("*") if path.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    yield root
    for folder in folders:
        folder.chmod(0o755)


@pytest.fixture
def temporary(tmp_path: Path) -> Path:
    """A temporary directory of everybody, like /tmp."""
    own = [path for path in tmp_path.parents if path.is_relative_to(tempfile.gettempdir())]
    for path in (tmp_path, *own[:-1]):  # pytest's own are closed to other users
        path.chmod(path.stat().st_mode | 0o055)
    place = tmp_path / "tmp"
    place.mkdir()
    place.chmod(0o1777)
    return place


def private(temporary: Path) -> Path:
    return temporary / f"ferguson-gym-{other_user.uid()}"


@pytest.mark.parametrize("home", [None, slow("/"), slow("/nonexistent")])
def test_without_a_place_of_ones_own_there_is_one_below_the_temporary_directory(
    home: str | None, tree: Path, temporary: Path
) -> None:
    here = temporary / "here"  # where Numba would make a directory named ~
    here.mkdir()
    here.chmod(0o1777)
    if home == "/" and not other_user.prefix() and os.access("/", os.W_OK):
        pytest.skip("this user can write /")
    first = other_user.run(RUN, tree, here, home, TMPDIR=str(temporary))
    result, place, hits = first.stdout.split()
    mine = private(temporary)
    assert (result, hits) == ("8.0", "0")
    assert Path(place).is_relative_to(mine / "numba")
    assert mine.stat().st_mode & 0o777 == 0o700
    assert mine.stat().st_uid == other_user.uid()
    warning, notice = first.stderr.splitlines()
    assert warning.startswith(f"machine code is cached in {mine}, since neither the folder of ")
    assert "NUMBA_CACHE_DIR" in warning
    assert notice == COMPILING
    again = other_user.run(RUN, tree, here, home, TMPDIR=str(temporary))
    assert again.stdout.split() == ["8.0", place, "1"]
    assert again.stderr == ""
    assert list(here.iterdir()) == []


def test_a_directory_that_the_user_names_is_used(tree: Path, temporary: Path) -> None:
    named = {"TMPDIR": str(temporary), "NUMBA_CACHE_DIR": str(temporary / "named")}
    done = other_user.run(RUN, tree, Path("/"), None, **named)
    assert Path(done.stdout.split()[1]).is_relative_to(temporary / "named")
    assert done.stderr == f"{COMPILING}\n"
    assert not private(temporary).exists()


@pytest.mark.parametrize(
    "trap", ["of another user", slow("of everybody"), "a link", slow("a file")]
)
def test_a_directory_into_which_others_could_put_machine_code_is_not_used(
    trap: str, tree: Path, temporary: Path
) -> None:
    place, target = private(temporary), temporary / "target"
    if trap == "of another user":
        if not other_user.prefix():
            pytest.skip("only root can make another user's directory")
        place.mkdir(mode=0o777)
        place.chmod(0o777)
    elif trap == "a file":
        place.touch()
    else:
        chosen = target if trap == "a link" else place
        chosen.mkdir()
        chosen.chmod(0o700 if trap == "a link" else 0o777)
        if other_user.prefix():
            os.chown(chosen, other_user.UID, other_user.UID)
        if trap == "a link":
            place.symlink_to(target)
    done = other_user.run(RUN, tree, Path("/"), None, TMPDIR=str(temporary))
    assert done.stdout.split()[0] == "8.0"
    warning, notice = done.stderr.splitlines()
    assert warning.startswith("machine code is not cached, since neither the folder of ")
    assert "set NUMBA_CACHE_DIR to a directory of your own" in warning
    assert notice == COMPILING
    assert place.is_file() or list(place.iterdir()) == []


def test_a_temporary_directory_in_which_others_can_replace_it_is_not_used(
    tree: Path, temporary: Path
) -> None:
    temporary.chmod(0o777)  # without the sticky bit
    done = other_user.run(RUN, tree, Path("/"), None, TMPDIR=str(temporary))
    assert done.stderr.startswith("machine code is not cached")


def test_without_a_temporary_directory_there_is_no_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "missing"))
    assert cache_directory.private_directory.__wrapped__() is None


@pytest.mark.parametrize("home", [None, slow("/nonexistent")])
def test_matplotlib_is_quiet_and_keeps_its_fonts(
    home: str | None, tree: Path, temporary: Path
) -> None:
    package = "agents.plots.figure" if home else "ferguson_gym.rendering"
    program = f"import {package}, matplotlib.font_manager; print(matplotlib.get_cachedir())"
    done = other_user.run(program, tree, Path("/"), home, TMPDIR=str(temporary))
    assert done.stdout.strip() == str(private(temporary) / "matplotlib"), done.stderr
    assert "MPLCONFIGDIR" not in done.stderr
    assert list((private(temporary) / "matplotlib").glob("fontlist*.json"))


def test_matplotlib_keeps_the_directory_of_the_user(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("MPLCONFIGDIR", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    cache_directory.find_matplotlib_cache()
    assert "MPLCONFIGDIR" not in os.environ


@pytest.mark.slow
def test_the_environment_flies_and_is_drawn_as_such_a_user(tree: Path, temporary: Path) -> None:
    program = """
import gymnasium, numpy, ferguson_gym
env = gymnasium.make("ferguson/ObstacleField-v0", render_mode="rgb_array")
env.reset(seed=0)
env.step(numpy.zeros(4, numpy.float32))
print(env.render().shape)
"""
    done = other_user.run(program, tree, Path("/"), None, TMPDIR=str(temporary))
    assert done.stdout == "(800, 800, 3)\n", done.stderr
    assert len(done.stderr.splitlines()) == 2
