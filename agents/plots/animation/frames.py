"""A flight told in shots: what each frame of an animation shows, and for how long."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from agents.flights.flight import Flight
from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import derivative, evaluate
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS

OPENING, MOVE, END = 1.2, 0.05, 4.0
"""Seconds that a frame is shown: before the flight, on the move, at the end."""
THOUGHT, THOUGHTS = 0.35, 12.0
"""Seconds that a search is shown, and as long again its result; and all of them, at most."""
STRIDE = 1.5
"""Least way between two frames on the move [m]."""
MOVES = 100
"""Frames on the move, about, of a flight that is longer than so many strides."""
_T = np.linspace(0.0, 1.0, 121)


def _none() -> Array:
    return np.empty((0, 4, 2))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Shot:
    """What one frame shows."""

    seconds: float
    """How long it is shown."""
    caption: str
    position: Array
    """(2,) of the vehicle [m]."""
    heading: Array
    """(2,) its derivative [m per unit t]."""
    flown: Array = field(default_factory=_none)
    """Segments (n, 4, 2) flown whole."""
    trail: Array = field(default_factory=lambda: np.empty((0, 2)))
    """Points (m, 2) of the segment that is being flown, as far as it was."""
    plan: Array = field(default_factory=_none)
    """Segments (n, 4, 2) that are meant to be flown."""
    candidates: Sequence[Array] = ()
    """First guesses, each (n, 4, 2)."""
    start: Array | None = None
    """The guess (n, 4, 2) that the plan came from."""
    origin: Array | None = None
    """(2,) where the plan was made, if it looked only so far [m]."""
    reach: float = 0.0
    """How far it looked from there [m]."""
    known: Field | None = None
    """The field as far as the planner knew it; None: all of it."""
    route: Array | None = None
    """Points (n, 2) that a plan of the whole path came from."""
    refused: Array | None = None
    """The segment (4, 2) that ended the flight without being flown."""


def frames_of(flight: Flight) -> Iterator[Shot]:
    """The shots of a flight: in each window the search, its result, then on the move; the end."""
    control = flight.control
    lengths = length(control) if len(control) else np.empty(0)
    stride = max(STRIDE, float(lengths.sum()) / MOVES)
    searches = sum(len(decision.candidates) > 0 for decision in flight.decisions)
    thought = min(THOUGHT, 0.5 * THOUGHTS / max(searches, 1))
    exact = flight.exact_length
    shot = Shot(
        seconds=OPENING,
        caption="" if exact is None else f"shortest path {exact:.2f} m",
        position=flight.field.start,
        heading=flight.field.departure,
        route=None if flight.route is None else flight.route.points,
    )
    yield shot
    for step in range(max(len(control), len(flight.decisions))):
        shot = replace(shot, flown=control[:step], trail=np.empty((0, 2)))
        way = float(lengths[:step].sum())
        shot = _intent(flight, step, replace(shot, caption=_caption(flight, step, way)))
        if shot.candidates:
            yield replace(shot, plan=_none(), start=None, seconds=thought)
        if len(shot.plan) and (shot.candidates or step == 0):
            yield replace(shot, candidates=(), seconds=thought if shot.candidates else OPENING)
        if step == len(control):
            break
        points, slopes = evaluate(control[step], _T), derivative(control[step], _T)
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        part = np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum()
        frames = max(1, round(lengths[step] / stride))
        for share in np.arange(1, frames + 1) / frames:
            k = int(np.abs(part - share).argmin())
            yield (
                shot := replace(
                    shot,
                    seconds=MOVE,
                    caption=_caption(flight, step, way + share * lengths[step]),
                    position=points[k],
                    heading=slopes[k],
                    trail=points[: k + 1],
                    candidates=(),
                    start=None,
                )
            )
    yield _end(flight, shot)


def _caption(flight: Flight, step: int, way: float) -> str:
    """Segment, way flown [m] and time of its decision."""
    tracked = len(flight.decisions) == 1 < len(flight.control)
    seconds = flight.decision_seconds[0 if tracked else step]
    told = f"{'planned' if tracked else 'decided'} in {1000.0 * seconds:.1f} ms"
    flown = f"{way:.1f}".rjust(5, "\N{FIGURE SPACE}")  # as wide as a digit: nothing jumps
    return f"segment {step + 1} · {told} · {flown} m"


def _intent(flight: Flight, step: int, shot: Shot) -> Shot:
    """A shot with what was meant to be flown when a segment was chosen, and why."""
    if step >= len(flight.decisions):  # one plan, tracked
        return replace(shot, plan=shot.plan[1:])
    decision = flight.decisions[step]
    plan = _none() if decision.chain is None else decision.chain
    candidates = [guess for _, guess in decision.candidates]
    chosen = [guess for name, guess in decision.candidates if name == decision.report.start]
    searched = len(candidates) > 0
    return replace(
        shot,
        plan=plan,
        candidates=candidates,
        start=chosen[-1] if chosen else None,
        origin=shot.position if searched else None,
        reach=len(candidates[-1]) * PAPER_LIMITS.longest if searched else 0.0,
        known=decision.known,
    )


def _end(flight: Flight, shot: Shot) -> Shot:
    """The last shot: the flight alone, or what it failed at."""
    told = f"{len(flight.control)} segments · {flight.length:.2f} m"
    if flight.gap is not None:
        told += f" · gap {100.0 * flight.gap:.2f} %"
    if not flight.success:
        told += f" · {flight.outcome.sentence}"
    last = flight.decisions[-1].candidates if flight.decisions and not flight.success else ()
    return replace(
        shot,
        seconds=END,
        caption=told,
        flown=flight.control,
        trail=np.empty((0, 2)),
        plan=_none(),
        candidates=[guess for _, guess in last],
        start=None,
        origin=None if flight.success else shot.origin,
        refused=flight.refused,
    )
