"""The frames of an animated flight: what each shows, and for how long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from agents.flights import Flight
from ferguson_gym.curves import evaluate, length
from ferguson_gym.rendering.motion import FPS, STRIDE, parts
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field

OPENING, MOVE, END = 1.2, 1.0 / FPS, 4.0
"""Seconds for which a frame is shown: before the flight, in motion, at the end."""
THOUGHT, THOUGHTS = 0.35, 12.0
"""Seconds for which a search is shown, and again its result; upper limit of their sum."""
MOVES = 100
"""Approximate number of frames in motion of a flight that is longer than this many strides."""
_T = np.linspace(0.0, 1.0, 60)
_NO_SEGMENTS, _NO_POINTS = np.empty((0, 4, 2)), np.empty((0, 2))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Frame:
    """The content of one frame."""

    seconds: float
    """Seconds for which the frame is shown."""
    caption: str
    position: Array
    """(2,) of the vehicle [m]."""
    heading: Array
    """(2,) its derivative [m per unit t]."""
    flown: Array = field(default_factory=lambda: _NO_SEGMENTS)
    """Segments (n, 4, 2) that are flown completely."""
    trail: Array = field(default_factory=lambda: _NO_POINTS)
    """Points (m, 2) of the part of the current segment that is flown [m]."""
    plan: Array = field(default_factory=lambda: _NO_SEGMENTS)
    """Planned segments (n, 4, 2)."""
    candidates: Sequence[Array] = ()
    """Initial guesses, each (n, 4, 2)."""
    start: Array | None = None
    """The initial guess (n, 4, 2) that led to the plan."""
    origin: Array | None = None
    """(2,) position from which the plan was made [m]; None: it had no limited range."""
    reach: float = 0.0
    """Range of the plan from its origin [m]."""
    known: Field | None = None
    """The part of the field that the planner knew; None: all of it."""
    route: Array | None = None
    """Points (n, 2) of the route that a whole-path plan was fitted to [m]."""
    refused: Array | None = None
    """The segment (4, 2) that ended the flight without being flown."""


def frames_of(flight: Flight) -> Iterator[Frame]:
    """The frames of a flight: in each window the search, its result and the motion; the end."""
    control = flight.control
    lengths = length(control) if len(control) else np.empty(0)
    stride = max(STRIDE, float(lengths.sum()) / MOVES)
    searches = sum(len(decision.candidates) > 0 for decision in flight.decisions)
    pause = min(THOUGHT, 0.5 * THOUGHTS / max(searches, 1))
    exact = flight.exact_length
    frame = Frame(
        seconds=OPENING,
        caption="" if exact is None else f"shortest path {exact:.2f} m",
        position=flight.field.start,
        heading=flight.field.departure,
        route=None if flight.route is None else flight.route.points,
    )
    yield frame
    for step in range(max(len(control), len(flight.decisions))):
        frame = replace(frame, flown=control[:step], trail=_NO_POINTS)
        distance = float(lengths[:step].sum())
        frame = _intent(flight, step, replace(frame, caption=_caption(flight, step, distance)))
        if frame.candidates:
            yield replace(frame, plan=_NO_SEGMENTS, start=None, seconds=pause)
        if len(frame.plan) and (frame.candidates or step == 0):
            yield replace(frame, candidates=(), seconds=pause if frame.candidates else OPENING)
        if step == len(control):
            break
        for moving in _motion(flight, step, frame, stride, distance):
            yield moving
            frame = moving
    yield _end(flight, frame)


def _motion(
    flight: Flight, step: int, frame: Frame, stride: float, distance: float
) -> Iterator[Frame]:
    """The frames in which a segment is flown, one a stride [m], after some flown distance [m]."""
    metres = float(length(flight.control[step]))
    flown = list(parts(flight.control[step], stride))
    for number, part in enumerate(flown, start=1):
        yield replace(
            frame,
            seconds=MOVE,
            caption=_caption(flight, step, distance + metres * number / len(flown)),
            position=part[1],
            heading=part[3],
            trail=evaluate(part, _T),
            candidates=(),
            start=None,
        )


def _caption(flight: Flight, step: int, distance: float) -> str:
    """Number of the segment, decision time, and distance flown [m]."""
    tracked = len(flight.decisions) == 1 < len(flight.control)
    seconds = flight.decision_seconds[0 if tracked else step]
    text = f"{'planned' if tracked else 'decided'} in {1000.0 * seconds:.1f} ms"
    flown = f"{distance:.1f}".rjust(5, "\N{FIGURE SPACE}")  # a figure space is as wide as a digit
    return f"segment {step + 1} · {text} · {flown} m"


def _intent(flight: Flight, step: int, frame: Frame) -> Frame:
    """A frame with the plan behind a segment, and the guesses that it was chosen from."""
    if step >= len(flight.decisions):  # a whole-path plan, which is tracked
        return replace(frame, plan=frame.plan[1:])
    decision = flight.decisions[step]
    plan = _NO_SEGMENTS if decision.chain is None else decision.chain
    candidates = [guess for _, guess in decision.candidates]
    chosen = [guess for name, guess in decision.candidates if name == decision.report.start]
    searched = len(candidates) > 0
    return replace(
        frame,
        plan=plan,
        candidates=candidates,
        start=chosen[-1] if chosen else None,
        origin=frame.position if searched else None,
        reach=len(candidates[-1]) * flight.field.limits.longest if searched else 0.0,
        known=decision.known,
    )


def _end(flight: Flight, frame: Frame) -> Frame:
    """The last frame: the whole flight, and for a failure its cause."""
    text = f"{len(flight.control)} segments · {flight.length:.2f} m"
    if flight.gap is not None:
        text += f" · gap {100.0 * flight.gap:.2f} %"
    if not flight.success:
        text += f" · {flight.outcome.sentence}"
    last = flight.decisions[-1].candidates if flight.decisions and not flight.success else ()
    return replace(
        frame,
        seconds=END,
        caption=text,
        flown=flight.control,
        trail=_NO_POINTS,
        plan=_NO_SEGMENTS,
        candidates=[guess for _, guess in last],
        start=None,
        origin=None if flight.success else frame.origin,
        refused=flight.refused,
    )
