"""Programs run by a user to whom nothing belongs, as in a container."""

import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

UID = 54321
"""A number that no user has."""
_AS_OTHER = [
    *("setpriv", f"--reuid={UID}", f"--regid={UID}", "--clear-groups"),
    # the interpreter may be in a folder of root's that only root can read
    *("--inh-caps=+dac_read_search", "--ambient-caps=+dac_read_search"),
]


@cache
def prefix() -> tuple[str, ...]:
    """Words before a command that let another user run it; none where this one is not root.

    Another user than root is stopped by the modes of read-only files, root is not.
    """
    if os.geteuid() != 0:
        return ()
    if shutil.which(_AS_OTHER[0]) is None or subprocess.run([*_AS_OTHER, "true"]).returncode:
        pytest.skip("root cannot become another user here")
    return tuple(_AS_OTHER)


def uid() -> int:
    """Number of the user who runs programs."""
    return UID if prefix() else os.geteuid()


def run(
    program: str, tree: Path, directory: Path, home: str | None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run a Python program as such a user.

    Args:
        program: its source.
        tree: directory of the packages.
        directory: where it runs.
        home: value of HOME; None: no HOME.
        environment: more variables.
    """
    kept = {name: os.environ[name] for name in ("PATH", "LD_LIBRARY_PATH") if name in os.environ}
    given = {} if home is None else {"HOME": home}
    return subprocess.run(
        [*prefix(), sys.executable, "-W", "error", "-P", "-c", program],
        cwd=directory,
        env={**kept, "PYTHONPATH": str(tree), **given, **environment},
        capture_output=True,
        text=True,
    )
