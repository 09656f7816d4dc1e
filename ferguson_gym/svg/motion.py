"""Animation of a flight in SVG: trails that grow, marks that appear, a vehicle that moves.

The vehicle moves at a constant speed along the path; at the end of the flight the picture rests,
and then begins again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.svg.axes import PIXEL

_REST = 2.0
"""Seconds for which the end of a flight is shown."""
_DART = "M-5 0L-8 7L10 0L-8-7Z"
"""The vehicle at the origin, flying to the right [px]."""


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """When each segment of a flight is flown.

    Raises:
        ValueError: a duration that is not positive and finite.
    """

    lengths: Array
    """Arc lengths (n,) of the segments [m]."""
    seconds: float
    """Duration of the flight [s]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < np.inf:
            raise ValueError(f"an animation takes a number of seconds above 0, got {self.seconds}")

    @property
    def period(self) -> float:
        """Duration of the animation, with the rest at its end [s]."""
        return self.seconds + _REST

    @property
    def flown(self) -> float:
        """The end of the flight, as a part of the period."""
        return self.seconds / self.period

    @property
    def ends(self) -> Array:
        """The end of each segment (n,), as a part of the period."""
        if len(self.lengths) == 0:
            return np.empty(0)
        whole = float(self.lengths.sum()) or 1.0  # of segments that stand still
        ends: Array = self.flown * np.cumsum(self.lengths) / whole
        return ends


def _repeated(timeline: Timeline) -> str:
    return f'dur="{timeline.period:g}s" repeatCount="indefinite"'


def appearing(timeline: Timeline, time: float) -> str:
    """The animation of an element that appears at a time, a part of the period."""
    return (
        f'<animate attributeName="opacity" values="0;1" keyTimes="0;{time:.5f}" '
        f'calcMode="discrete" {_repeated(timeline)}/>'
    )


def trailing(timeline: Timeline, segment: int) -> str:
    """The animation of a line that grows while a segment is flown.

    The line is one dash at least as long as itself, `{length}` in the text returned.
    """
    end = float(timeline.ends[segment])
    begin = float(timeline.ends[segment - 1]) if segment else 0.0
    values = "{length};{length};0;0"
    # a round cap would show a dash that ends at the start of the line
    return (
        f'<animate attributeName="stroke-dashoffset" values="{values}" '
        f'keyTimes="0;{begin:.5f};{end:.5f};1" {_repeated(timeline)}/>' + appearing(timeline, begin)
    )


def moving(timeline: Timeline, path: str) -> str:
    """The vehicle that moves along path data; hidden where nothing is animated."""
    dart = f'<path d="{_DART}" transform="scale({PIXEL})" stroke="white" stroke-width="0.8"/>'
    times = f'keyPoints="0;1;1" keyTimes="0;{timeline.flown:.5f};1" calcMode="linear"'
    return (
        '<g visibility="hidden"><set attributeName="visibility" to="visible"/>'
        f'{dart}<animateMotion path="{path}" rotate="auto" {times} {_repeated(timeline)}/></g>'
    )
