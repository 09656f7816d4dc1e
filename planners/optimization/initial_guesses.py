"""First guesses for a window: the shifted plan, a straight line, random feasible chains.

The paper leaves open how its random guesses choose derivatives and what the very first
guess is; the choices made here are named in the docstrings.

Reference:
    The paper, section III-C6.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.transition import State

RandomGuess: TypeAlias = Callable[[np.random.Generator, State, int, Limits, int], Array]
"""Draws some chains (count, segments, 4, D) from a state; they need not be feasible."""
FirstGuess: TypeAlias = Callable[[State, Array, int, Limits], Sequence[tuple[str, Array]]]
"""Chains (segments, 4, D) by name that a window is searched from first: of a state, the plan
(m, 4, D) that was not flown yet, the number of segments and the limits."""


class Proposer(Protocol):
    """Someone else's idea of how to go on, a learned agent's for example."""

    def propose(self, field: Field, state: State, segments: int, seed: int) -> Sequence[Array]:
        """Chains (n, 4, D) from a state; none, if it has no idea.

        They need not be feasible. One of fewer than so many segments ends on the goal, or is the
        beginning of an idea.
        """


def as_planned(state: State, tail: Array, segments: int, limits: Limits) -> list[tuple[str, Array]]:
    """The shifted plan, the paper's first guess; straight ahead where there is no plan yet."""
    if len(tail):
        return [("shifted", shifted(state, tail, segments))]
    return [("straight", straight(state, segments, limits))]


def nothing(state: State, tail: Array, segments: int, limits: Limits) -> list[tuple[str, Array]]:
    """No first guess, so that all guesses are random."""
    return []


def straight(state: State, segments: int, limits: Limits) -> Array:
    """A straight chain (segments, 4, D) along the state's derivative, of middling length.

    Our choice where there is no earlier plan to shift.
    """
    step = 0.5 * (limits.shortest + limits.longest)
    speed = np.linalg.norm(state.derivative)
    if speed > 0.0:
        ahead = step * state.derivative / speed
    else:  # as actions have it: along the first axis
        ahead = step * np.eye(len(state.derivative))[0]
    points = state.position + np.arange(segments + 1)[:, None] * ahead
    return through(state, points)


def shifted(state: State, tail: Array, segments: int) -> Array:
    """The segments of the last plan not flown yet, the last point and derivative repeated.

    Args:
        state: where the vehicle is; the chain starts there.
        tail: (m, 4, D) segments planned and not flown, m >= 1.
        segments: number of segments of the chain.

    Returns:
        (segments, 4, D); repeated segments have no length and are not feasible, but free to
        expand.
    """
    chain = np.empty((segments, 4, tail.shape[-1]))
    chain[: len(tail)] = tail[:segments]
    chain[0, 0], chain[0, 2] = state.position, state.derivative
    for k in range(len(tail), segments):
        chain[k] = chain[k - 1, (1, 1, 3, 3), :]
    return chain


def along(state: State, points: Array, segments: int, length: float) -> Array:
    """A chain (segments, 4, 2) with evenly spaced knots on the first part of a route.

    Args:
        state: where the chain starts.
        points: (m, 2) of the route, from the state on [m].
        segments: number of segments of the chain.
        length: of that part, measured along the points [m].
    """
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(chords)])
    at = np.linspace(0.0, length, segments + 1)
    return through(state, np.column_stack([np.interp(at, way, axis) for axis in points.T]))


def random_chains(
    stream: np.random.Generator, state: State, segments: int, limits: Limits, count: int
) -> Array:
    """Random chains (count, segments, 4, D), in the plane; they need not be feasible.

    Each point lies in a uniformly random direction from the one before, at a distance
    uniform between the shortest and the longest segment. Our choice of derivatives: half
    the way from the point before to the point after (Catmull-Rom), at the end the last
    step itself.
    """
    distance = stream.uniform(limits.shortest, limits.longest, (count, segments))
    angle = stream.uniform(-np.pi, np.pi, (count, segments))
    steps = distance[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.empty((count, segments + 1, 2))
    points[:, 0] = state.position
    points[:, 1:] = state.position + np.cumsum(steps, axis=1)
    return through(state, points)


def through(state: State, points: Array) -> Array:
    """Chains (*batch, n, 4, D) through points (*batch, n + 1, D), Catmull-Rom derivatives."""
    slopes = np.empty_like(points)
    slopes[..., 0, :] = state.derivative
    slopes[..., 1:-1, :] = 0.5 * (points[..., 2:, :] - points[..., :-2, :])
    slopes[..., -1, :] = points[..., -1, :] - points[..., -2, :]
    return np.stack(
        [points[..., :-1, :], points[..., 1:, :], slopes[..., :-1, :], slopes[..., 1:, :]], axis=-2
    )
