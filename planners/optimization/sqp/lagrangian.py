"""The Lagrangian of a window at an expanded chain, compiled: its gradient and exact Hessian."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled, compiled_in_place
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.elastic_qp import Program
from planners.optimization.sqp.expansion import Expansion, Layout
from planners.optimization.sqp.turn_contacts import LEFT, add_turn_hessian


@compiled
def warm_start_multipliers(
    old: Expansion,
    program: Program,
    new: Expansion,
    contacts: int,
    across: bool,
    tension: Array,
    carried: Array,
) -> None:
    """Transfer a step's multipliers to the point that it leads to.

    Args:
        old: the chain that the step was computed for.
        program: its quadratic program, solved.
        new: the chain after the step.
        contacts: number of contacts of `new`.
        across: whether contacts with obstacles may pass from one segment to the next, as they do
            beside corners.
        tension: (n,) output, the multipliers of the lengths.
        carried: (room,) output; each multiplier goes to the nearest contact of the same kind.
    """
    segments, multipliers, taken = len(tension), program.multipliers, program.taken
    for k in range(segments):
        tension[k] = multipliers[k] - multipliers[segments + k]
    carried[:contacts] = 0.0
    for index in range(2 * segments, program.number[0]):
        if multipliers[index] == 0.0:
            continue
        before = old.contact[taken[index - 2 * segments]]
        nearest, best = 2.0, -1
        for candidate in range(contacts):
            after = new.contact[candidate]
            if after.segment == before.segment and after.what == before.what:
                apart = abs(after.t - before.t)
                if apart < nearest:
                    nearest, best = apart, candidate
        if across and best < 0 and before.what >= 0:
            for candidate in range(contacts):
                after = new.contact[candidate]
                apart = abs(after.t + after.segment - before.t - before.segment)
                if after.what == before.what and apart < nearest:
                    nearest, best = apart, candidate
        if best >= 0:
            carried[best] += multipliers[index]


@compiled_in_place
def _add_segment(
    layout: Layout,
    here: Expansion,
    k: int,
    factor: float,
    bending: Array,
    gradient: Array,
    hessian: Array,
) -> None:
    """Add `factor` times the Hessian of segment k's length, and its weighted bending."""
    place, weight = layout.place[k], 2.0 * layout.bending_weight
    for i in range(8):
        if place[i] < 0:
            continue
        for j in range(8):
            if place[j] >= 0:
                hessian[place[i], place[j]] += factor * here.length_curvature[k, i, j]
        if weight != 0.0:
            for b in range(4):
                bend = weight * bending[i // 2, b]
                gradient[place[i]] += bend * here.control[k, b, i % 2]
                j = 2 * b + i % 2
                if place[j] >= 0:
                    hessian[place[i], place[j]] += bend


@compiled_in_place
def _add_objective(
    slope: Array, curvature: Array, inner: Array, gradient: Array, hessian: Array
) -> None:
    """Add the derivatives of F(l, P) by the chain rule; `inner` (3, m) are those of l and P."""
    m = len(gradient)
    for i in range(m):
        for a in range(3):
            gradient[i] += slope[a] * inner[a, i]
            for b in range(3):
                factor = curvature[a, b] * inner[a, i]
                if factor != 0.0:
                    for j in range(m):
                        hessian[i, j] += factor * inner[b, j]


@compiled
def lagrangian(
    layout: Layout,
    here: Expansion,
    contacts: int,
    slope: Array,
    curvature: Array,
    tension: Array,
    multiplier: Array,
    bending: Array,
    gradient: Array,
    hessian: Array,
) -> None:
    """Fill the gradient of the objective and the Hessian of the Lagrangian.

    Args:
        layout: the chain and its limits.
        here: the chain, expanded, with some contacts.
        contacts: their number.
        slope: (3,) gradient of the objective F(l, P) with respect to l and P.
        curvature: (3, 3) Hessian of F.
        tension: (n,) multiplier of each length, negative at the longest.
        multiplier: (contacts,) of each contact, >= 0.
        bending: (4, 4) weights of products of control rows in the bending.
        gradient: (m,), filled.
        hessian: (m, m), filled.
    """
    segments = len(here.length)
    gradient[:] = hessian[:] = 0.0
    # gradients of the objective's arguments: length, and the end's coordinates
    inner = np.zeros((3, len(gradient)))
    for d in range(2):
        if layout.place[segments - 1, 2 + d] >= 0:
            inner[1 + d, layout.place[segments - 1, 2 + d]] = 1.0
    for k in range(segments):
        inner[0] += here.length_slope[k]
        _add_segment(layout, here, k, slope[0] - tension[k], bending, gradient, hessian)
    _add_objective(slope, curvature, inner, gradient, hessian)
    for row in range(contacts):
        if multiplier[row] != 0.0:
            contact = here.contact[row]
            place = layout.place[contact.segment]
            if contact.what > LEFT:
                _add_contact(hessian, -multiplier[row], here, row, place)
            else:
                control, radius = here.control[contact.segment], layout.turn_radius
                add_turn_hessian(
                    hessian, -multiplier[row], here.contact, row, control, radius, place
                )


@compiled
def _add_contact(hessian: Array, factor: float, here: Expansion, row: int, place: Integers) -> None:
    """Add `factor` times the Hessian of a contact's clearance; see `CONTACT`."""
    contact = here.contact[row]
    nx, ny = contact.normal[0], contact.normal[1]
    weight, mixed, drift = contact.weight, contact.mixed, contact.drift
    for i in range(8):
        for j in range(8):
            if place[i] < 0 or place[j] < 0:
                continue
            if i % 2 != j % 2:
                across = -nx * ny
            elif i % 2 == 0:
                across = ny * ny
            else:
                across = nx * nx
            value = weight[i // 2] * weight[j // 2] * across * contact.inverse
            if drift != 0.0:
                value -= drift * mixed[i] * mixed[j]
            hessian[place[i], place[j]] += factor * value
