"""Figures in a common style, written atomically."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ferguson_gym.rendering import drawing
from ferguson_gym.runtime.atomic_files import atomic_write


@contextmanager
def figure_file(
    path: Path, width: float, height: float, layout: Literal["constrained"] | None = "constrained"
) -> Iterator[Figure]:
    """A figure of a width and height [in] to draw on, written when the block ends without an error.

    The path's suffix decides the format. Without a layout engine axes are placed by hand.
    """
    with mpl.rc_context(drawing.style()):
        figure = Figure(figsize=(width, height), layout=layout)
        FigureCanvasAgg(figure)
        yield figure
        with atomic_write(path) as temporary:
            figure.savefig(temporary)
