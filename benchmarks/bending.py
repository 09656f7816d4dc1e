"""What a little bending energy in the objective does to windows and flights.

Run it from a checkout: `.venv/bin/python benchmarks/bending.py [FIELDS]`. multi-start flies
standard/train:0 to FIELDS - 1 (50 by default) with each weight; lengths are compared with the
flights without bending through the same fields.
"""

from __future__ import annotations

import sys

import numpy as np
from rich.console import Console
from rich.table import Table

from ferguson_gym.world.field_names import get_fields
from planners.interface import Plan, initial_state
from planners.optimization.window import WindowSettings
from planners.receding_horizon.paper import RecedingHorizon

WEIGHTS = (0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2)


def main(number: int) -> None:
    """Fly every weight and print a row for each."""
    fields = list(get_fields(f"standard/train:0-{number - 1}"))
    table = Table(title=f"multi-start on standard/train:0-{number - 1}")
    for column in (
        "bending weight [1/m]",
        "arrived",
        "evaluations/start",
        "step [ms]",
        "length / without",
        "interquartile range",
        "least turn radius [m]",
    ):
        table.add_column(column, justify="right")
    RecedingHorizon().plan(fields[0], initial_state(fields[0]), 0)
    without: dict[str, float] = {}
    for weight in WEIGHTS:
        planner = RecedingHorizon(settings=WindowSettings(bending_weight=weight))
        plans: dict[str, Plan] = {
            field.name: planner.plan(field, initial_state(field), 0) for field in fields
        }
        paths = {name: plan.path for name, plan in plans.items() if plan.path is not None}
        if weight == 0.0:
            without = {name: path.length for name, path in paths.items()}
        ratios = [paths[name].length / without[name] for name in paths if name in without]
        reports = [
            decision.report
            for plan in plans.values()
            for decision in plan.decisions
            if decision.report.starts
        ]
        evaluations = [report.evaluations / report.starts for report in reports]
        low, middle, high = np.percentile(ratios, [25, 50, 75])
        radius = np.median([path.min_turn_radius for path in paths.values()])
        table.add_row(
            f"{weight:g}",
            f"{len(paths)}/{len(plans)}",
            f"{np.median(evaluations):.1f}",
            f"{1e3 * np.median([report.seconds for report in reports]):.1f}",
            f"{middle:.5f}",
            f"{low:.5f} to {high:.5f}",
            f"{radius:.3g}",
        )
    Console(width=110).print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
