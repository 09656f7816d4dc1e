"""What a least turn radius costs the guided horizon, and how many flights without one keep it.

Run it from a checkout: `.venv/bin/python benchmarks/turn_radius.py [FIELDS]`, by default
standard/train:0-299. A field is blocked at a radius where a disc ahead of the start meets both
circles of that radius that leave the start: not even the sharpest turn at once, to either side,
passes it.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from ferguson_gym.shortest_paths.exact import exact_length, gap
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.turn_radius import keeps_turn_radius
from planners.interface import Plan, initial_state
from planners.receding_horizon.guided import Guided

RADII = (None, 2.5, 3.0, 5.0)
"""Least turn radii [m]; None turns at will."""


def blocked(field: Field, radius: float) -> bool:
    """Whether a disc ahead of the start meets both circles of a radius that leave it."""
    discs = field.obstacles
    assert discs.are_discs
    ahead = field.departure / np.linalg.norm(field.departure)
    left = np.array([-ahead[1], ahead[0]])
    offset = discs.centers - field.start
    along, across = offset @ ahead, np.abs(offset @ left)
    # the circle on the other side is the farther one
    return bool(((np.hypot(along, across + radius) < discs.radii + radius) & (along > 0.0)).any())


def main(spec: str) -> None:
    """Fly every field with every radius and print a row for each."""
    fields = list(get_fields(spec))
    exact = [exact_length(field) for field in fields]
    table = Table(title=f"guided on {spec}")
    for column in (
        "radius [m]",
        "arrived",
        "blocked at the start",
        "without limit",
        "gap, median [%]",
        "largest",
        "step [ms]",
        "failed, not blocked",
    ):
        table.add_column(column, justify="right")
    free: list[Plan] = []
    for radius in RADII:
        planner = Guided(min_turn_radius=radius)
        planner.plan(fields[0], initial_state(fields[0]), 0)
        began = time.process_time()
        plans = [planner.plan(field, initial_state(field), 0) for field in fields]
        spent = time.process_time() - began
        free = free or plans
        gaps = [
            100.0 * gap(plan.path.length, shortest)
            for plan, shortest in zip(plans, exact, strict=True)
            if plan.path is not None and shortest is not None
        ]
        kept = [
            plan.success and (radius is None or keeps_turn_radius(plan.control, radius).all())
            for plan in free
        ]
        stopped = [radius is not None and blocked(field, radius) for field in fields]
        failed = [
            field.name.split(":")[-1]
            for field, plan, stop in zip(fields, plans, stopped, strict=True)
            if not (plan.success or stop)
        ]
        for plan in plans:
            assert (
                not plan.success or radius is None or keeps_turn_radius(plan.control, radius).all()
            )
        table.add_row(
            "none" if radius is None else f"{radius:g}",
            f"{sum(plan.success for plan in plans)}/{len(plans)}",
            f"{sum(stopped)}",
            f"{sum(kept)}",
            f"{np.median(gaps):.3f}",
            f"{max(gaps):.2f}",
            f"{1e3 * spent / max(1, sum(len(plan.decisions) for plan in plans)):.2f}",
            ", ".join(failed) or "-",
        )
    Console(width=130).print(table)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "standard/train:0-299")
