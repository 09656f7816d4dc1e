"""The Lagrangian of a window at an expanded chain, compiled: its gradient and exact Hessian."""

from __future__ import annotations

import numpy as np

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.runtime.jit import compiled
from planners.optimization.sqp.contacts import Integers
from planners.optimization.sqp.expansion import Expansion, Layout
from planners.optimization.sqp.turn_contacts import LEFT, add_turn_hessian


@compiled
def warm_start_multipliers(
    old: Expansion,
    taken: Integers,
    multipliers: Array,
    new: Expansion,
    contacts: int,
    tension: Array,
    carried: Array,
) -> None:
    """Hand a step's multipliers on to the point it leads to.

    Args:
        old: the chain that the step was computed for.
        taken: its contacts that were rows after the lengths.
        multipliers: (n + rows,) of the lengths and of those rows.
        new: the chain after the step.
        contacts: their number there.
        tension: (n,) filled with the lengths'.
        carried: (room,) filled: each goes to the nearest contact of segment and thing.
    """
    segments = len(tension)
    tension[:] = multipliers[:segments]
    carried[:contacts] = 0.0
    for index in range(segments, len(multipliers)):
        if multipliers[index] == 0.0:
            continue
        before = old.contact[taken[index - segments]]
        nearest, best = 2.0, -1
        for candidate in range(contacts):
            after = new.contact[candidate]
            if after.segment == before.segment and after.what == before.what:
                apart = abs(after.t - before.t)
                if apart < nearest:
                    nearest, best = apart, candidate
        if best >= 0:
            carried[best] += multipliers[index]


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
        layout: which chain, among what.
        here: the chain, expanded.
        contacts: their number.
        slope: (3,) gradient of the objective F(l, P) with respect to l and P.
        curvature: (3, 3) Hessian of F.
        tension: (n,) multiplier of each length, negative at the longest.
        multiplier: (contacts,) of each contact, >= 0.
        bending: (4, 4) weights of products of control rows in the bending.
        gradient: (m,), filled.
        hessian: (m, m), filled.
    """
    m, segments = len(gradient), len(here.length)
    gradient[:] = hessian[:] = 0.0
    inner = np.zeros((3, m))
    for d in range(2):
        if layout.place[segments - 1, 2 + d] >= 0:
            inner[1 + d, layout.place[segments - 1, 2 + d]] = 1.0
    stiffness = 2.0 * layout.stiffness
    for k in range(segments):
        inner[0] += here.length_slope[k]
        place = layout.place[k]
        factor = slope[0] - tension[k]
        for i in range(8):
            if place[i] < 0:
                continue
            for j in range(8):
                if place[j] >= 0:
                    hessian[place[i], place[j]] += factor * here.length_curvature[k, i, j]
            if stiffness != 0.0:
                for b in range(4):
                    stiff = stiffness * bending[i // 2, b]
                    gradient[place[i]] += stiff * here.control[k, b, i % 2]
                    j = 2 * b + i % 2
                    if place[j] >= 0:
                        hessian[place[i], place[j]] += stiff
    for i in range(m):
        for a in range(3):
            gradient[i] += slope[a] * inner[a, i]
            for b in range(3):
                factor = curvature[a, b] * inner[a, i]
                if factor != 0.0:
                    for j in range(m):
                        hessian[i, j] += factor * inner[b, j]
    for row in range(contacts):
        if multiplier[row] != 0.0:
            contact = here.contact[row]
            place = layout.place[contact.segment]
            if contact.what > LEFT:
                _add_contact(hessian, -multiplier[row], here, row, place)
            else:
                control = here.control[contact.segment]
                add_turn_hessian(
                    hessian,
                    -multiplier[row],
                    here.contact,
                    row,
                    control,
                    layout.turn_radius,
                    place,
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
