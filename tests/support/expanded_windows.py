"""Windows expanded to second order, and the clearances of their contacts by definition."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from ferguson_gym.curves.splines import derivative, evaluate
from planners.optimization.quadrature import BENDING
from planners.optimization.sqp.contacts import HIGH, LOW, SPEED
from planners.optimization.sqp.expansion import Expansion, Layout, empty_expansion, expand
from planners.optimization.sqp.iterate import layout_of
from planners.optimization.sqp.lagrangian import lagrangian
from planners.optimization.window import Window
from tests.support.random_windows import Case

REACH = 5.0


NUMBERS = ("clearance", "t", "weight", "normal", "inverse", "drift")
"""What every contact has; `mixed` is filled where a contact moves."""


@dataclass
class Expanded:
    """A window's chain, expanded."""

    window: Window
    x: np.ndarray
    layout: Layout
    out: Expansion
    count: int
    violation: float
    length: float
    bent: float

    @property
    def contact(self) -> np.ndarray:
        return self.out.contact[: self.count]

    @property
    def slope(self) -> np.ndarray:
        return self.out.slope[: self.count]

    @property
    def things(self) -> np.ndarray:
        """What each contact is: equal rows mean the same contact of a chain close by."""
        contact = self.contact
        return np.stack([contact["segment"], contact["what"], contact["drift"] > 0.0], axis=1)

    def gradient_and_hessian(
        self, tension: np.ndarray, multiplier: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Of the Lagrangian, with multipliers of the lengths and of the contacts."""
        m = self.out.slope.shape[1]
        gradient, hessian = np.empty(m), np.empty((m, m))
        _, slope, curvature = self.window.objective.expand(self.length, self.out.control[-1, 1])
        lagrangian(
            self.layout,
            self.out,
            self.count,
            slope,
            curvature,
            tension,
            multiplier,
            BENDING,
            gradient,
            hessian,
        )
        gradient -= tension @ self.out.length_slope + multiplier @ self.slope
        return gradient, hessian


def expanded(
    window: Window, x: np.ndarray, reach: float = REACH, room: int = 1024, **layout: object
) -> Expanded:
    whole = layout_of(window, window.obstacles)._replace(**layout)
    out = empty_expansion(window.chain.segments, len(x), room)
    return Expanded(window, x, whole, out, *expand(x, whole, reach, out))


def ordinary(seed: int, segments: int = 3, final: bool = False) -> tuple[Window, np.ndarray]:
    """A window, and unknowns of a random chain in its box."""
    window, guess = Case(seed, segments=segments, final=final).draw()
    noise = np.random.default_rng(seed).normal(0.0, 1.0, guess.shape)
    return window, np.clip(window.chain.unknowns(guess + noise), *window.box)


def clearances(here: Expanded, contact: np.ndarray) -> np.ndarray:
    """By definition, at the contacts' parameters."""
    control, layout = here.out.control, here.layout
    values = []
    for segment, what, t in zip(contact["segment"], contact["what"], contact["t"], strict=True):
        (point,), (slope,) = evaluate(control[segment], [t]), derivative(control[segment], [t])
        if what >= 0:
            value = np.hypot(*(point - layout.centers[what])) - layout.radii[what]
        elif what == SPEED:
            value = np.hypot(*slope) - layout.slowest
        elif what > HIGH:
            value = (point - layout.bounds[0])[LOW - what]
        else:
            value = (layout.bounds[1] - point)[HIGH - what]
        values.append(value)
    return np.array(values)


windows = st.builds(
    ordinary,
    seed=st.integers(0, 2**32 - 1),
    segments=st.integers(1, 4),
    final=st.booleans(),
)
