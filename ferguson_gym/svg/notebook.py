"""What notebooks show of objects that have a picture."""

from __future__ import annotations

from typing import Any

from ferguson_gym.svg.picture import Picture


class ShowsPicture:
    """Mixin of objects that notebooks show as their picture."""

    __slots__ = ()

    def picture(self) -> Picture:
        """The picture of the object.

        Raises:
            ValueError: there is nothing to draw in the plane.
        """
        raise NotImplementedError

    def _repr_svg_(self) -> str | None:
        """What a notebook shows; None if the object has no picture."""
        try:
            return self.picture()._repr_svg_()
        except ValueError:
            return None

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, str]:
        """The picture, and its caption as the text beside it, which would list all arrays."""
        shown = self._repr_svg_()
        if shown is None:
            return {}
        text = f"<{type(self).__name__}: {self.picture().caption}>"
        return {"image/svg+xml": shown, "text/plain": text}
