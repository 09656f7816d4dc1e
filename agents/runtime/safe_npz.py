"""Arrays from a file that may be damaged: all of them at once, or the reason why not."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays in an npz file, by name; none of objects, which would be unpickled.

    Raises:
        ValueError: it cannot be read; the message is the reason, which the file's name should
            precede.
    """
    try:
        # opened here: NumPy leaves a file open whose contents are no zip
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored}
    except Exception as error:  # of whatever the libraries make of a damaged file
        raise ValueError(reason(error)) from None


def reason(error: Exception) -> str:
    """What a library says of a damaged file, short and on one line."""
    return " ".join(str(error).split())[:120] or type(error).__name__
