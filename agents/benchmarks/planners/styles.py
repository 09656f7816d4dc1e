"""Colours and markers of planners, the same in all figures."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

COLOURS = (
    *("#0b5fa5", "#e07b00", "#1e8449", "#c0392b", "#8e44ad", "#17a2b8", "#d63384"),
    *("#7a5c2e", "#9aa50f", "#3b3b98", "#f4b000", "#444444", "#f28cb1", "#00b388"),
    *("#a65628", "#5c1a33"),
)
"""At least as many different colours as there are planners."""
MARKERS: tuple[str | tuple[int, int, int], ...] = (*"osD^vP<X>pd8*hH", (4, 1, 0))
"""The last one is a star with four points."""


@dataclass(frozen=True, slots=True)
class Style:
    """How a planner is drawn."""

    colour: str
    marker: str | tuple[int, int, int]
    """As matplotlib takes it."""
    size: float
    """Of the marker [pt]; later planners have smaller ones, so that all are visible."""

    @property
    def spot(self) -> dict[str, Any]:
        """Settings of a marker, for matplotlib."""
        shape = {"marker": self.marker, "ms": self.size, "mec": "white", "mew": 0.7}
        return {"color": self.colour, "zorder": 5, **shape}  # above all lines


def styles_of(planners: Sequence[str]) -> dict[str, Style]:
    """The style of each planner by name."""
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=True)
    return {
        name: Style(*look, 8.5 - 2.5 * k / len(planners))
        for k, (name, look) in enumerate(zip(planners, looks, strict=False))
    }
