"""Start-up time of a fresh process until the first step, and memory of many environments.

`_first_step` and `_memory` run in fresh processes. To measure import times correctly, this module
itself imports only modules that every Python process has loaded.
"""

import sys
import time

MANY = 2048
"""Number of environments whose memory is measured."""
STARTS = 3
"""Number of fresh processes, of which the median is reported."""


def measure(observation: str, with_compilation: bool) -> dict[str, float | None]:
    """Measure times and memory in fresh processes.

    Returns:
        import_seconds; first_step_seconds, from import to the end of the first step;
        compile_seconds, the same with an empty cache; process_bytes, resident with one
        environment; many_bytes, added by `MANY` more. Values are None if not measured or not
        available on the system.
    """
    import statistics
    import tempfile

    starts = [_ask("_first_step", observation, {}) for _ in range(STARTS)]
    compiling = None
    if with_compilation:
        with tempfile.TemporaryDirectory() as empty:
            compiling = _ask("_first_step", observation, {"NUMBA_CACHE_DIR": empty})[1]
    process, many = _ask("_memory", observation, {}) or (None, None)
    return {
        "import_seconds": statistics.median(imported for imported, _ in starts),
        "first_step_seconds": statistics.median(stepped for _, stepped in starts),
        "compile_seconds": compiling,
        "process_bytes": process,
        "many_bytes": many,
    }


def _ask(question: str, observation: str, more: dict[str, str]) -> list[float]:
    import os
    import subprocess
    from pathlib import Path

    # import the same packages as this process
    root = str(Path(__file__).parents[3])
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    program = (
        f"from agents.benchmarks.environment.startup import {question}; {question}({observation!r})"
    )
    answer = subprocess.run(
        [sys.executable, "-P", "-c", program],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **more, "PYTHONPATH": path},
    )
    if answer.returncode:
        raise RuntimeError(f"a fresh process failed:\n{answer.stderr}")
    return [float(word) for word in answer.stdout.split()]


def _first_step(observation: str) -> None:
    """Print the seconds until the package is imported, and until the end of a first step."""
    began = time.perf_counter()
    import ferguson_gym

    imported = time.perf_counter()
    import gymnasium as gym
    import numpy as np

    env = gym.make(ferguson_gym.ENVIRONMENT_ID, observation=observation)
    env.reset(seed=0)
    env.step(np.zeros(4, np.float32))
    sys.stdout.write(f"{imported - began} {time.perf_counter() - began}")


def _memory(observation: str) -> None:
    """Print the bytes of a process with one environment, and those added by many; if known."""
    import os
    from pathlib import Path

    import gymnasium as gym
    import numpy as np

    import ferguson_gym

    statm = Path("/proc/self/statm")

    def resident() -> int:
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    if not statm.exists():
        return
    env = gym.make(ferguson_gym.ENVIRONMENT_ID, observation=observation)
    env.reset(seed=0)
    env.step(np.zeros(4, np.float32))
    process = resident()
    envs = gym.make_vec(ferguson_gym.ENVIRONMENT_ID, MANY, observation=observation)
    envs.reset(seed=0)
    for _ in range(10):
        envs.step(np.zeros((MANY, 4), np.float32))
    sys.stdout.write(f"{process} {resident() - process}")
