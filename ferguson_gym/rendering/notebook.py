"""Live pictures in the output of a notebook, one that is updated in place."""

from __future__ import annotations

import sys
from typing import Any

from ferguson_gym.rendering.raster import caption
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome


def is_inline(backend: str) -> bool:
    """Whether matplotlib's backend is the one that prints still pictures in notebooks."""
    return "inline" in backend.lower() and "IPython" in sys.modules


class NotebookOutput:
    """A picture in a notebook that follows a flight.

    A flight has one picture, in the output of the cell in which it began; flights of one cell share
    a picture. IPython is there already, since the backend is a part of it.
    """

    def __init__(self) -> None:
        self._handle: Any = None
        self._cell: Any = None

    def begin(self) -> None:
        """Begin another flight: it gets a picture of its own if this is another cell."""
        if self._cell != _running_cell():
            self._handle = None

    def frame(self, field: Field, control: Array, refused: Array | None, outcome: Outcome) -> None:
        """Show a flight in place of what was shown before."""
        picture = field.picture()
        picture.caption = caption(field, control, outcome)
        picture.add_chain(control)
        if refused is not None:
            picture.add_refused(refused)
        if self._handle is None:
            self._cell = _running_cell()
            self._handle = sys.modules["IPython"].display.display(picture, display_id=True)
        else:
            self._handle.update(picture)


def _running_cell() -> Any:
    """Number of the cell that runs; None outside of IPython."""
    shell = sys.modules["IPython"].get_ipython()
    return None if shell is None else shell.execution_count
