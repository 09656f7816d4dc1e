"""Environments in processes of their own, which end with their use, however it ends."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

import gymnasium as gym


@contextmanager
def in_processes(makers: Sequence[Callable[[], gym.Env[Any, Any]]]) -> Iterator[Any]:
    """A `SubprocVecEnv` of Stable-Baselines3."""
    from stable_baselines3.common.vec_env import SubprocVecEnv

    envs = None
    try:
        with _uninterrupted():
            # spawned, for a process with threads must not be forked
            envs = SubprocVecEnv(list(makers), start_method="spawn")
        yield envs
        envs.close()
    finally:
        if envs is not None:
            # after an interruption a pipe may hold half an answer: no polite words
            for process, pipe in zip(envs.processes, envs.remotes, strict=True):
                process.terminate()
                process.join()
                pipe.close()
            envs.closed = True


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Put an interruption off; processes started meanwhile never see one, and print nothing."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    asked: list[int] = []
    resource_tracker.ensure_running()  # to start it later would let interruptions through
    before = signal.signal(signal.SIGINT, lambda number, _: asked.append(number))
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited; the handler is not
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        signal.signal(signal.SIGINT, before)
    if asked:
        raise KeyboardInterrupt
