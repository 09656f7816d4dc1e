"""Colours and markers of planners, the same in all figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

COLOURS = (
    "#0b5fa5",
    "#e07b00",
    "#1e8449",
    "#c0392b",
    "#8e44ad",
    "#17a2b8",
    "#d63384",
    "#7a5c2e",
    "#9aa50f",
    "#3b3b98",
    "#f4b000",
    "#444444",
    "#f28cb1",
)
"""At least as many different colours as there are planners."""
MARKERS = "osD^vP<X>pd8*"


@dataclass(frozen=True, slots=True)
class Style:
    """How a planner is drawn."""

    colour: str
    marker: str
    size: float
    """Of the marker [pt]; later planners have smaller ones, so that all are visible."""

    @property
    def spot(self) -> dict[str, Any]:
        """Settings of a marker, for matplotlib."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "ms": self.size,
            "mec": "white",
            "mew": 0.7,
            "zorder": 5,  # above all lines
        }


def styles_of(planners: Sequence[str]) -> dict[str, Style]:
    """The style of each planner by name."""
    return {
        name: Style(
            COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)], 8.5 - 2.5 * k / len(planners)
        )
        for k, name in enumerate(planners)
    }
