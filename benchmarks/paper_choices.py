"""How the flights through the paper's fields depend on what the paper leaves open.

Run it from a checkout: `.venv/bin/python benchmarks/paper_choices.py [SEEDS]`. Every variant
flies multi-start through the four fields with policy seeds 0 to SEEDS - 1 (3 by default).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from joblib import Parallel, delayed
from rich.console import Console
from rich.table import Table

from ferguson_gym.runtime.arrays import Array
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.limits import Limits
from ferguson_gym.world.paper_fields import TABLE_I
from ferguson_gym.world.transition import State
from planners.interface import Plan, initial_state
from planners.optimization.initial_guesses import random_chains
from planners.optimization.sqp.elastic_sqp import ElasticSqp
from planners.optimization.sqp.multi_start import MultiStart
from planners.optimization.window import WindowSettings
from planners.receding_horizon.paper import RecedingHorizon


def along_the_next_step(
    stream: np.random.Generator, state: State, segments: int, limits: Limits, count: int
) -> Array:
    """Random guesses whose derivative at a point is the step that follows it."""
    chains = random_chains(stream, state, segments, limits, count)
    steps = chains[:, :, 1] - chains[:, :, 0]
    chains[:, :-1, 3] = chains[:, 1:, 2] = steps[:, 1:]
    return chains


def in_a_random_direction(
    stream: np.random.Generator, state: State, segments: int, limits: Limits, count: int
) -> Array:
    """Random guesses whose derivatives have random directions and lengths of 3 to 15 m."""
    chains = random_chains(stream, state, segments, limits, count)
    angle = stream.uniform(-np.pi, np.pi, (count, segments))
    size = stream.uniform(limits.shortest, limits.longest, (count, segments))
    slopes = size[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    chains[:, :, 3], chains[:, 1:, 2] = slopes, slopes[:, :-1]
    return chains


def leaving_with(speed: float, field: Field) -> Field:
    """The field with a start derivative of another length."""
    return replace(
        field, start_derivative=field.departure * speed / np.linalg.norm(field.departure)
    )


def with_gate(gate: float, field: Field) -> Field:
    """The field with another gate [m]."""
    return field.with_limits(gate=gate)


def unchanged(field: Field) -> Field:
    """The field itself."""
    return field


Change = Callable[[Field], Field]
VARIANTS: dict[str, tuple[RecedingHorizon, Change]] = {
    "as shipped": (RecedingHorizon(), unchanged),
    "gate 0.5 m": (RecedingHorizon(), partial(with_gate, 0.5)),
    "gate 2 m": (RecedingHorizon(), partial(with_gate, 2.0)),
    "start derivative 2 m": (RecedingHorizon(), partial(leaving_with, 2.0)),
    "start derivative 12 m": (RecedingHorizon(), partial(leaving_with, 12.0)),
    "guesses: along next step": (RecedingHorizon(random_guess=along_the_next_step), unchanged),
    "guesses: random tangents": (RecedingHorizon(random_guess=in_a_random_direction), unchanged),
    "precision 1e-3": (
        RecedingHorizon(solver=MultiStart(search=ElasticSqp(precision=1e-3))),
        unchanged,
    ),
    "precision 1e-7": (
        RecedingHorizon(solver=MultiStart(search=ElasticSqp(precision=1e-7))),
        unchanged,
    ),
    "no guess abandoned": (
        RecedingHorizon(solver=MultiStart(search=ElasticSqp(patience=math.inf))),
        unchanged,
    ),
    "no sidestep": (RecedingHorizon(solver=MultiStart(sidesteps=())), unchanged),
    "bending 1e-5": (RecedingHorizon(settings=WindowSettings(bending_weight=1e-5)), unchanged),
}


def fly(variant: str, field: Field, seed: int) -> Plan:
    """One flight of a variant."""
    planner, change = VARIANTS[variant]
    changed = change(field)
    return planner.plan(changed, initial_state(changed), seed)


def main(seeds: int) -> None:
    """Fly every variant and print a row for each."""
    fields = list(get_fields("paper:1-4"))
    table = Table(title=f"multi-start on paper:1-4, {seeds} seeds each")
    for column in (
        "variant",
        "arrived",
        "segments",
        "func. eval.",
        "<= 1.01 paper",
        "1",
        "2",
        "3",
        "4",
    ):
        table.add_column(column, justify="left" if column == "variant" else "right")
    for variant in VARIANTS:
        tasks = [(field, seed) for field in fields for seed in range(seeds)]
        plans: list[Plan] = Parallel(n_jobs=2)(delayed(fly)(variant, *task) for task in tasks)
        lengths: dict[str, list[float]] = {field.name: [] for field in fields}
        near = 0
        for (field, _), plan in zip(tasks, plans, strict=True):
            if plan.path is not None:
                lengths[field.name].append(plan.path.length)
                near += plan.path.length <= 1.01 * (TABLE_I["multi-start", field.name].length or 0)
        solved = [plan for plan in plans if plan.success]
        table.add_row(
            variant,
            f"{len(solved)}/{len(plans)}",
            f"{np.median([len(plan.control) for plan in solved]):.0f}",
            f"{np.median([plan.evaluations for plan in solved]):.0f}",
            f"{near}/{len(plans)}",
            *(f"{np.median(values):.2f}" if values else "-" for values in lengths.values()),
        )
        print(variant, "done", file=sys.stderr, flush=True)
    Console(width=120).print(table)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
