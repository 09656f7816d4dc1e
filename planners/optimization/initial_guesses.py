"""Initial guesses for a window: the shifted plan, a straight line, random feasible chains.

Reference:
    The paper, section III-C6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world import Field, Limits, State

RandomGuess: TypeAlias = Callable[[np.random.Generator, State, int, Limits, int], Array]
"""Draws some chains (count, segments, 4, D) from a state; they need not be feasible."""
FirstGuess: TypeAlias = Callable[[State, Array, int, Limits], Sequence[tuple[str, Array]]]
"""Makes named chains (segments, 4, D) from a state, the rest (m, 4, D) of the last plan, the number
of segments and the limits; they need not be feasible."""


class Proposer(Protocol):
    """A source of initial guesses outside of the planner, for example a learned agent."""

    def propose(self, field: Field, state: State, segments: int, seed: int) -> Sequence[Array]:
        """Propose chains (n, 4, D) from a state; the list may be empty.

        They need not be feasible. A chain with fewer segments than `segments` either ends on the
        goal or is to be extended.
        """


def shifted_or_straight(
    state: State, tail: Array, segments: int, limits: Limits
) -> list[tuple[str, Array]]:
    """The paper's initial guess, the shifted plan; a straight chain if nothing is planned yet."""
    if len(tail):
        return [("shifted", shifted(state, tail, segments))]
    return [("straight", straight_ahead(state, segments, limits))]


def no_guess(state: State, tail: Array, segments: int, limits: Limits) -> list[tuple[str, Array]]:
    """Make no first guess, so that all guesses are random."""
    return []


def straight_ahead(state: State, segments: int, limits: Limits) -> Array:
    """A straight chain (segments, 4, D) along the state's derivative, of medium length.

    Our choice if there is no earlier plan to shift.
    """
    step = 0.5 * (limits.shortest + limits.longest)
    speed = np.linalg.norm(state.derivative)
    ahead = step * np.eye(len(state.derivative))[0]  # along the first axis, as actions do
    if speed > 0.0:
        ahead = step * state.derivative / speed
    points = state.position + np.arange(segments + 1)[:, None] * ahead
    return catmull_rom(state, points)


def shifted(state: State, tail: Array, segments: int) -> Array:
    """The rest (m, 4, D) of the last plan from a state, padded to a chain (segments, 4, D).

    m >= 1. The padding repeats the last point and derivative: its segments have length zero, which
    is infeasible, but a solver can extend them.
    """
    chain = np.empty((segments, 4, tail.shape[-1]))
    chain[: len(tail)] = tail[:segments]
    chain[0, 0], chain[0, 2] = state.position, state.derivative
    for k in range(len(tail), segments):
        chain[k] = chain[k - 1, (1, 1, 3, 3), :]
    return chain


def along_route(state: State, points: Array, segments: int, length: float) -> Array:
    """A chain (segments, 4, 2) with evenly spaced knots on the first part of a route.

    The points (m, 2) of the route begin at the state; `length` is measured along them [m].
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(chords)])
    at = np.linspace(0.0, length, segments + 1)
    return catmull_rom(state, np.column_stack([np.interp(at, way, axis) for axis in points.T]))


def random_chains(
    stream: np.random.Generator, state: State, segments: int, limits: Limits, count: int
) -> Array:
    """Random chains (count, segments, 4, 2); they need not be feasible.

    Each point lies in a uniformly random direction from the one before, at a distance drawn
    uniformly between the shortest and the longest segment. The paper leaves the derivatives open:
    our choice is that of `catmull_rom`.
    """
    distance = stream.uniform(limits.shortest, limits.longest, (count, segments))
    angle = stream.uniform(-np.pi, np.pi, (count, segments))
    steps = distance[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.empty((count, segments + 1, 2))
    points[:, 0] = state.position
    points[:, 1:] = state.position + np.cumsum(steps, axis=1)
    return catmull_rom(state, points)


def catmull_rom(state: State, points: Array) -> Array:
    """Chains (*batch, n, 4, D) through points (*batch, n + 1, D) with Catmull-Rom derivatives.

    Reference:
        Catmull & Rom (1974), A class of local interpolating splines, Computer Aided Geometric
        Design.
    """
    slopes = np.empty_like(points)
    slopes[..., 0, :] = state.derivative
    slopes[..., 1:-1, :] = 0.5 * (points[..., 2:, :] - points[..., :-2, :])
    slopes[..., -1, :] = points[..., -1, :] - points[..., -2, :]
    return np.stack(
        [points[..., :-1, :], points[..., 1:, :], slopes[..., :-1, :], slopes[..., 1:, :]], axis=-2
    )
