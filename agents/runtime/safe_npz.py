"""Read an npz file that may be damaged, without unpickling."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file by name; arrays of objects are refused.

    Raises:
        ValueError: The file cannot be read. The message is the reason; callers put the name of the
            file before it.
    """
    try:
        # opened here: NumPy does not close a file that is not a zip file
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored}
    except Exception as error:  # the libraries raise errors of many types on a damaged file
        raise ValueError(reason(error)) from None


def reason(error: Exception) -> str:
    """The message of a library's error, shortened to one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
