"""Environments in subprocesses, which a context manager always ends when its block exits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import gymnasium as gym

from agents.runtime.interrupts import shield_new_processes


@contextmanager
def in_processes(makers: Sequence[Callable[[], gym.Env[Any, Any]]]) -> Iterator[Any]:
    """A `SubprocVecEnv` of Stable-Baselines3, whose processes end with the block."""
    from stable_baselines3.common.vec_env import SubprocVecEnv

    envs = None
    try:
        with shield_new_processes():
            # spawned, since a process with threads must not be forked
            envs = SubprocVecEnv(list(makers), start_method="spawn")
        yield envs
        envs.close()
    finally:
        if envs is not None:
            # after an interruption a pipe may hold half an answer, so processes are terminated
            for process, pipe in zip(envs.processes, envs.remotes, strict=True):
                process.terminate()
                process.join()
                pipe.close()
            envs.closed = True
