"""Where machine code and fonts are cached if neither the package nor a home can be written.

In a container the package often belongs to another user and there is no home. Numba then refuses
to define a cached function, and matplotlib searches for fonts at every start. Both are given a
directory below the temporary one. Cached machine code is executed, so another user who could write
there could run code as this one; the directory is therefore used only if it is this user's alone.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

T = TypeVar("T")

_config: Any = numba.config
_unusual: set[str] = set()
"""Where kernels of this process are cached that could not be cached in the usual places."""
_NOWHERE = ""


def with_cache(decorate: Callable[[bool], T], source: str) -> T:
    """Apply one of Numba's decorators with a cache where that is possible.

    The usual places come first: NUMBA_CACHE_DIR, the source's `__pycache__`, the user's cache.

    Args:
        decorate: applies the decorator; its argument says whether machine code is cached.
        source: file of the function that is decorated.

    Returns:
        The decorated function.
    """
    if _usual_places(source):
        try:
            return decorate(True)
        except RuntimeError:  # Numba found no place that it can write
            pass
    if (place := private_directory()) is not None:
        before, _config.CACHE_DIR = _config.CACHE_DIR, str(place / "numba")
        try:
            function = decorate(True)
            _unusual.add(str(place))
            return function
        except RuntimeError:
            pass
        finally:
            _config.CACHE_DIR = before
    _unusual.add(_NOWHERE)
    return decorate(False)


def warning() -> str | None:
    """What a user should know about where machine code is cached; None in the usual places."""
    if not _unusual:
        return None
    reason = "neither the folder of ferguson-gym nor a home directory can be written"
    if _NOWHERE in _unusual:
        return (
            f"machine code is not cached, since {reason}: every start compiles again; set "
            "NUMBA_CACHE_DIR to a directory of your own"
        )
    return (
        f"machine code is cached in {', '.join(sorted(_unusual))}, since {reason}; "
        "NUMBA_CACHE_DIR names another directory"
    )


def _usual_places(source: str) -> bool:
    """Whether Numba may look for a place itself.

    Without a home it would make a directory named ~ where the program happens to run.
    """
    if _config.CACHE_DIR or "XDG_CACHE_HOME" in os.environ or _home() is not None:
        return True
    return _can_write(Path(source).parent / "__pycache__")


def _home() -> Path | None:
    home = Path(os.path.expanduser("~"))  # Path.home raises if there is none
    return home if home.is_absolute() else None


def _can_write(directory: Path) -> bool:
    """Whether files can be made in a directory, which may have to be made first."""
    while not directory.exists():
        directory = directory.parent
    return os.access(directory, os.W_OK | os.X_OK)


@cache
def private_directory() -> Path | None:
    """A directory of this user below the temporary one, made if need be.

    Returns:
        Its path, the same in every process of this user; None if it cannot be made, if another
        user owns it or can write it, or if another user could replace it.
    """
    try:
        parent = Path(tempfile.gettempdir())
        if os.name != "posix":  # there the temporary directory is the user's own
            place = parent / "ferguson-gym"
            place.mkdir(exist_ok=True)
            return place
        place = parent / f"ferguson-gym-{os.geteuid()}"
        if not place.is_symlink():
            place.mkdir(mode=0o700, exist_ok=True)
        above, mine = parent.stat(), place.lstat()
    except OSError:
        return None
    replaceable = above.st_mode & 0o022 and not above.st_mode & stat.S_ISVTX
    own = stat.S_ISDIR(mine.st_mode) and mine.st_uid == os.geteuid() and not mine.st_mode & 0o077
    return None if replaceable or not own else place


def find_matplotlib_cache() -> None:
    """Set MPLCONFIGDIR to a private directory if matplotlib can write no other.

    Call it before matplotlib is imported: matplotlib would report a temporary directory and
    search for fonts at every start.
    """
    if "MPLCONFIGDIR" in os.environ:
        return
    home = _home()
    for variable, folder in (("XDG_CONFIG_HOME", ".config"), ("XDG_CACHE_HOME", ".cache")):
        given = os.environ.get(variable)
        below = Path(given) if given else home and home / folder
        if below is None or not _can_write(below / "matplotlib"):
            break
    else:
        return
    if (place := private_directory()) is not None:
        (place / "matplotlib").mkdir(exist_ok=True)
        os.environ["MPLCONFIGDIR"] = str(place / "matplotlib")
