"""Atomic writes: a temporary file in the same directory is written and then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path beside `path`; move it into place if the block succeeds.

    The temporary name keeps the suffix, which many writers read the format from. A block
    that raises leaves nothing behind, and an older file at `path` untouched.
    """
    target = Path(path)
    handle, name = tempfile.mkstemp(prefix=".writing-", suffix=target.suffix, dir=target.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        # mkstemp makes files private; give it what a plain open() would have given
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def unwritable(directory: str | os.PathLike[str]) -> str | None:
    """The error of writing a file in an existing directory; None if it succeeds."""
    # a file is written, since permissions mislead for root and on some file systems
    try:
        with tempfile.TemporaryFile(dir=directory):
            return None
    except OSError as error:
        return error.strerror or str(error)
