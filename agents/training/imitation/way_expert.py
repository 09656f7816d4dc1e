"""An expert for many states at once: segments of one stride along the way, as `pursuit` flies them.

It knows what observations with `way` show, so that a network can learn to do the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ferguson_gym.curves.certified_kernels import make_scratch
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from ferguson_gym.simulation.field_store import FieldArrays, cores_of
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts
from ferguson_gym.simulation.step_buffers import Records
from ferguson_gym.simulation.step_kernel import limits_of
from ferguson_gym.world.actions import Action, decode_into, encode_ends
from ferguson_gym.world.feasibility import FLYING, first_failure
from ferguson_gym.world.limits import PAPER_LONGEST

STRIDES = (7.0, 5.25, 9.0, 4.0)
"""Approximate lengths of segments, tried in turn [units of the field]; a whole number of them ends
on the goal."""
_BESIDE = 0.5
"""Distance along the way over which its direction is taken, to both sides [units of the field]."""
_NONE = np.empty((1, 0))


def label(rollouts: SimulatedRollouts) -> tuple[Action, NDArray[np.bool_]]:
    """The expert's actions (n, 4) for the active rollouts, and which of them it knows (n,).

    An action is known if its segment is certified, and if it does not end on the goal another one
    of the same stride after it.
    """
    buffers = rollouts.buffers
    flights, fields = buffers.flights, buffers.fields
    slots, positions = flights["slot"], np.ascontiguousarray(flights["position"])
    units = fields.records["longest"][slots] / PAPER_LONGEST
    actions, known = np.zeros((len(flights), 4), np.float32), np.zeros(len(flights), np.bool_)
    togo = rollouts.ways.ahead(slots, positions, _NONE)[1] / units
    left = np.maximum(flights["most"] - flights["segments"], 1)
    for stride in STRIDES:
        which = np.flatnonzero(np.isfinite(togo) & ~known)
        if not len(which):
            break
        number = np.clip(np.rint(togo[which] / stride), 1, left[which])
        length = togo[which] / number
        knots = np.stack([length, np.where(number > 1, 2.0 * length, length)], axis=1)
        at = (knots[:, :, None] + [-_BESIDE, 0.0, _BESIDE]).reshape(len(which), 6)
        places = rollouts.ways.ahead(slots[which], positions[which], at)[0]
        before, ends, after = places.reshape(-1, 2, 3, 2).transpose(2, 0, 1, 3)
        slopes = after - before
        size = np.linalg.norm(slopes, axis=2, keepdims=True)
        slopes *= (length * units[which])[:, None, None] / np.maximum(size, 1e-9)
        derivatives = flights["derivative"][which]
        asked, inside = encode_ends(
            ends[:, 0] - positions[which], slopes[:, 0], derivatives, units[which]
        )
        fine = np.empty(len(which), np.bool_)
        _certify(fields, flights[which], asked, ends, slopes, number > 1, fine)
        fine &= inside
        actions[which[fine]], known[which[fine]] = asked[fine], True
    return actions, known


@compiled
def _certify(
    fields: FieldArrays,
    flights: Records,
    actions: Action,
    ends: Array,
    slopes: Array,
    follows: NDArray[np.bool_],
    fine: NDArray[np.bool_],
) -> None:
    """Whether actions, and the segments that follow them, are feasible.

    Args:
        fields: of the flights.
        flights: (m,) of FLIGHT.
        actions: (m, 4).
        ends: (m, 2, 2) end points of the segment and of the one that follows [m].
        slopes: (m, 2, 2) their end derivatives [m per unit t].
        follows: (m,) whether there is one that follows.
        fine: (m,), filled.
    """
    scratch = make_scratch((0, 1), fields.discs.shape[2], fields.corners.shape[2])
    control = np.empty((4, 2))
    for i in range(len(flights)):
        flight = flights[i]
        slot = flight.slot
        field = fields.records[slot]
        limits = limits_of(field, flight)
        unit = limits.longest / PAPER_LONGEST
        position, derivative = flight.position, flight.derivative
        decode_into(control, actions[i], position, derivative, field.goal, limits.gate, unit)
        fine[i] = True
        for part in range(2 if follows[i] else 1):
            if part == 1:
                control[0], control[1] = ends[i, 0], ends[i, 1]
                control[2], control[3] = slopes[i, 0], slopes[i, 1]
            outcome, _, _ = first_failure(
                control,
                field.bounds,
                fields.discs[slot, :2],
                fields.discs[slot, 2],
                cores_of(fields, slot),
                limits,
                np.inf,
                scratch,
            )
            fine[i] &= outcome == FLYING
