"""The trust region of a search, and the regularisation and precision that change with it.

Reference:
    Conn, Gould & Toint (2000), Trust-region methods, SIAM, chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass

_SMALLEST = 1e-7
"""Radius [m] below which a search stops."""


@dataclass(slots=True, eq=False)
class TrustRegion:
    """Radius of the trust region, and lower bound on the model's curvature."""

    radius: float
    """For points [m]; three times as much for derivatives."""
    floor: float
    """Lower bound on the curvature of the model [m per square of an unknown]."""
    precision: float
    """Relative predicted gain of a step below which the search stops."""

    @property
    def collapsed(self) -> bool:
        """Whether the region is too small for any step."""
        return self.radius < _SMALLEST

    def after_failed_model(self) -> None:
        """Shrink and regularise after a quadratic program without a solution."""
        self.radius, self.floor = 0.25 * self.radius, 10.0 * self.floor

    def after_failed_restoration(self) -> None:
        """Shrink and search on more precisely where no feasible point was near."""
        self.radius, self.precision = 0.5 * self.radius, 0.25 * self.precision

    def after_rejected_step(self, size: float) -> None:
        """Shrink below the size of a step that the filter rejected."""
        self.radius = 0.25 * size

    def after_accepted_step(self, ratio: float, size: float, max_radius: float) -> None:
        """Adapt to a step by the ratio of the actual and the predicted decrease."""
        if ratio > 0.75 and size > 0.9 * self.radius:
            self.radius = min(2.0 * self.radius, max_radius)
        elif ratio < 0.25:
            self.radius = 0.5 * size
        elif ratio > 1.1:
            # the objective falls faster than predicted: the model is too curved
            self.floor = max(0.1 * self.floor, 1e-6)
