"""Which way round a vehicle is predicted to be fastest, and what the prediction costs.

Run it from a checkout: `.venv/bin/python benchmarks/fastest_classes.py [FIELDS]`, by default
standard/validation:0-39. Excesses are over `fastest_bound`. Beside the prediction stand the best
speeds along flights of `guided` with several turn radii, the best of them for each field.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from ferguson_gym.vehicles.bound import fastest_bound
from ferguson_gym.vehicles.ranked_classes import ranked_classes
from ferguson_gym.vehicles.speed_profile import fastest_along
from ferguson_gym.vehicles.vehicle_names import VEHICLES
from ferguson_gym.world.field_names import get_fields
from planners.registry import plan

CLASSES = 24
"""Number of classes that are ranked."""
RADII = (5, 8, 12, 16)
"""Turn radii of flights [m]."""


def excess(times: list[float], level: float) -> str:
    """A quantile of times over their bounds, infinite where too many flights are impossible."""
    return f"{100.0 * np.quantile(times, level, method='higher') - 100.0:.1f}"


def main(spec: str) -> None:
    """Rank the classes of every field for every vehicle, and print a row for each vehicle."""
    fields = list(get_fields(spec))
    flights = [
        [plan(field, f"guided+turn={radius}").control for radius in RADII] for field in fields
    ]
    table = Table(title=f"fastest classes of {spec}")
    for column in (
        "vehicle",
        "classes, median",
        "not the shortest",
        "place of the first, largest",
        "predicted excess, median [%]",
        "90 %",
        "best radius, median [%]",
        "90 %",
        "ms a class",
    ):
        table.add_column(column, justify="right")
    for vehicle in VEHICLES.values():
        numbers, places = list[int](), list[int]()
        predicted, flown = list[float](), list[float]()
        spent = 0.0
        for field, controls in zip(fields, flights, strict=True):
            began = time.process_time()
            ranked = ranked_classes(field, vehicle, CLASSES)
            spent += time.process_time() - began
            bound = fastest_bound(field, vehicle)
            if not ranked or bound is None:
                continue
            lengths = sorted(one.path.length for one in ranked)
            numbers.append(len(ranked))
            places.append(lengths.index(ranked[0].path.length) + 1)
            predicted.append(ranked[0].seconds / bound)
            times = [fastest_along(one, vehicle).seconds for one in controls if len(one)]
            flown.append(min(times, default=np.inf) / bound)
        table.add_row(
            vehicle.name,
            f"{np.median(numbers):g}",
            f"{sum(place > 1 for place in places)}/{len(places)}",
            str(max(places)),
            excess(predicted, 0.5),
            excess(predicted, 0.9),
            excess(flown, 0.5),
            excess(flown, 0.9),
            f"{1e3 * spent / sum(numbers):.1f}",
        )
    Console().print(table)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "standard/validation:0-39")
