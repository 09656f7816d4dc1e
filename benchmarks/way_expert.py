"""The expert `way` alone: its flights, and the time of its decisions, by suite and margin.

Run it from a checkout:

    .venv/bin/python benchmarks/way_expert.py
"""

from __future__ import annotations

import time

import numpy as np

from agents.training.imitation.way_expert import label
from ferguson_gym.shortest_paths import exact_length
from ferguson_gym.simulation import Settings, SimulatedRollouts
from ferguson_gym.world import get_field, initial_state

NUMBER = 200
"""Fields of each suite."""


def row(suite: str, margin: float) -> str:
    """A line of the table: success, SPL, median gap, and CPU time per decision, trees included."""
    fields = [get_field(f"{suite}/train:{seed}") for seed in range(NUMBER)]
    exact = np.array([exact_length(field) for field in fields], dtype=np.float64)
    lengths, decisions = np.full(NUMBER, np.inf), 0
    began = time.process_time()
    starts = [initial_state(field) for field in fields]
    flights = SimulatedRollouts(fields, np.arange(NUMBER), starts, Settings(margin=margin))
    while len(flights.active):
        actions, _ = label(flights)
        decisions += len(actions)
        active = flights.active
        flights.step(actions)
        lengths[active[flights.arrived]] = flights.lengths[flights.arrived]
        flights.keep(flights.flying)
    micro = 1e6 * (time.process_time() - began) / decisions
    success, spl = np.isfinite(lengths).mean(), np.mean(exact / np.maximum(lengths, exact))
    gap = np.median(lengths / exact) - 1.0
    return f"| {suite} | {margin:g} m | {success:.1%} | {spl:.3f} | {gap:.2%} | {micro:.0f} us |"


def main() -> None:
    """Print the table."""
    row("standard", 0.8)  # compiles
    print("| suite | margin | success | SPL | gap, median | a decision |")
    print("| --- | --- | --- | --- | --- | --- |")
    for suite in ("standard", "dense", "traps"):
        for margin in (0.8, 0.5, 0.4, 0.3):
            print(row(suite, margin), flush=True)


if __name__ == "__main__":
    main()
