"""The trust region of a search, and the regularisation and precision that change with it, compiled.

Reference:
    Conn, Gould & Toint (2000), Trust-region methods, SIAM, chapter 6.
"""

from __future__ import annotations

from typing import NamedTuple

from ferguson_gym.runtime.jit import compiled

SMALLEST = 1e-7
"""Radius [m] below which a search stops."""


class TrustRegion(NamedTuple):
    """Radius of the trust region, and lower bound on the model's curvature."""

    radius: float
    """For points [m]; three times as much for derivatives."""
    floor: float
    """Lower bound on the curvature of the model [m per square of an unknown]."""
    precision: float
    """Relative predicted gain of a step below which the search stops."""


@compiled
def after_failed_model(region: TrustRegion) -> TrustRegion:
    """Shrink and regularise after a quadratic program without a solution."""
    return TrustRegion(0.25 * region.radius, 10.0 * region.floor, region.precision)


@compiled
def after_failed_restoration(region: TrustRegion) -> TrustRegion:
    """Shrink and search on more precisely where no feasible point was near."""
    return TrustRegion(0.5 * region.radius, region.floor, 0.25 * region.precision)


@compiled
def after_rejected_step(region: TrustRegion, size: float) -> TrustRegion:
    """Shrink below the size of a step that the filter rejected."""
    return TrustRegion(0.25 * size, region.floor, region.precision)


@compiled
def after_accepted_step(
    region: TrustRegion, ratio: float, size: float, max_radius: float
) -> TrustRegion:
    """Adapt to a step by the ratio of the actual and the predicted decrease."""
    radius, floor, precision = region
    if ratio > 0.75 and size > 0.9 * radius:
        radius = min(2.0 * radius, max_radius)
    elif ratio < 0.25:
        radius = 0.5 * size
    elif ratio > 1.1:
        # the objective falls faster than predicted: the model is too curved
        floor = max(0.1 * floor, 1e-6)
    return TrustRegion(radius, floor, precision)
