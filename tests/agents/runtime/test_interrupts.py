"""A deferred Ctrl-C is raised where the program can stop, not earlier."""

import signal
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from agents.runtime.interrupts import defer_interrupt, raise_if_interrupted, shield_new_processes


def press() -> None:
    signal.raise_signal(signal.SIGINT)


def test_an_interrupt_is_raised_at_the_end_of_its_block(capfd: pytest.CaptureFixture[str]) -> None:
    done = []

    def work() -> None:
        with defer_interrupt(b"stopping\n") as interrupt:
            press()
            assert interrupt.pressed
            done.append("the rest of the block")

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        work()
    assert done
    assert capfd.readouterr().err == "stopping\n"
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("then", [raise_if_interrupted, press])
def test_it_is_raised_earlier_on_request_or_by_a_second_one(
    then: Callable[[], None],
) -> None:
    with defer_interrupt() as interrupt:
        raise_if_interrupted()
        press()
        with pytest.raises(KeyboardInterrupt):
            then()
        interrupt.pressed = False


def test_an_inner_block_leaves_the_interrupt_to_the_outer_one() -> None:
    with defer_interrupt() as outer:
        with defer_interrupt() as inner:
            press()
        assert inner is outer
        assert outer.pressed
        outer.pressed = False


def test_outside_the_main_thread_nothing_is_deferred() -> None:
    handlers = []

    def run() -> None:
        with defer_interrupt():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert handlers == [signal.getsignal(signal.SIGINT)]


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="POSIX only")
def test_new_processes_ignore_it() -> None:
    program = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"
    with shield_new_processes():
        assert subprocess.check_output([sys.executable, "-c", program]) == b"alive\n"
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
