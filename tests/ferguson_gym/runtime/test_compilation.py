"""The first compilation is announced once, and the garbage collector pauses meanwhile."""

import gc
import logging
import subprocess
import sys

import numba
import pytest
from numba.core import event

from ferguson_gym.runtime import compilation
from ferguson_gym.runtime.compilation import COMPILING, Compilation

MINE = (__name__.partition(".")[0],)


def test_the_first_compilation_is_announced_once(caplog: pytest.LogCaptureFixture) -> None:
    with event.install_listener("numba:compile", Compilation(MINE)):
        for number in (1.0, 2):
            numba.njit(lambda x: x)(number)
    announced = (compilation.__name__, logging.WARNING, COMPILING)
    assert caplog.record_tuples == [announced]


def test_kernels_of_other_packages_are_not_announced(caplog: pytest.LogCaptureFixture) -> None:
    with event.install_listener("numba:compile", Compilation(["another"])):
        numba.njit(lambda x: x)(1.0)
    assert caplog.record_tuples == []


@pytest.mark.parametrize("collects", [True, False])
def test_the_collector_pauses_and_is_left_as_it_was(collects: bool) -> None:
    seen = []

    class During(event.Listener):
        def on_start(self, event: object) -> None:
            seen.append(gc.isenabled())

        def on_end(self, event: object) -> None:
            pass

    def fails(x: object) -> object:
        return x.missing  # type: ignore[attr-defined]

    inner = numba.njit(lambda x: x + 1)
    outer = numba.njit(lambda x: inner(x))
    before = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        with (
            event.install_listener("numba:compile", Compilation(MINE)),
            event.install_listener("numba:compile", During()),
        ):
            outer(1)
            with pytest.raises(numba.TypingError):
                numba.njit(fails)(1)
        assert gc.isenabled() == collects
    finally:
        (gc.enable if before else gc.disable)()
    assert seen == [False] * 3


@pytest.mark.slow
def test_a_first_step_is_announced_where_warnings_are_errors(tmp_path: object) -> None:
    """Of the environment as users have it, with an empty cache."""
    program = """
import gymnasium, numpy, ferguson_gym
env = gymnasium.make("ferguson/ObstacleField-v0")
env.reset(seed=0)
env.step(numpy.zeros(4, numpy.float32))
"""
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env={"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout, done.stderr) == ("", f"{COMPILING}\n")
