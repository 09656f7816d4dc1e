"""What sampling misses: 29 points for clearance, 50 chords for length.

Run it from a checkout: `.venv/bin/python benchmarks/sampling.py [SEEDS]`. Windows of multi-start
along its flights through the paper's fields are solved from the shifted plan with sampled rows
alone, as in the paper, and then certified; the same segments are measured by 50 chords.
"""

from __future__ import annotations

import sys

import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.field_names import get_fields
from planners.interface import initial_state
from planners.optimization.initial_guesses import shifted
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.window import WindowSettings, horizon_window
from planners.receding_horizon.paper import RecedingHorizon


def main(seeds: int) -> None:
    """Print how deep sampled solutions cut, and how much chords fall short."""
    depths, shortages = [], []
    for field in get_fields("paper:1-4"):
        for seed in range(seeds):
            plan = RecedingHorizon(random_starts=3).plan(field, initial_state(field), seed)
            for state in plan.states:
                if not 1 <= len(state.tail) <= 2 or (state.tail[-1, 1] == field.goal).all():
                    continue
                window = horizon_window(field, state.vehicle, WindowSettings(), 3)
                problem = window.sampled()
                guess = problem.chain.unknowns(shifted(state.vehicle, state.tail, 3))
                solution = Slsqp().solve(problem, guess)
                if problem.c(solution.x).min() < -1e-6:
                    continue  # not even the samples are clear
                control = problem.chain.control(solution.x)
                depths.append(-field.obstacles.clearance(control).min())
                points = evaluate(control, np.linspace(0.0, 1.0, 51))
                chords = np.linalg.norm(np.diff(points, axis=1), axis=-1).sum(axis=1)
                shortages.extend(length(control) - chords)
    cut, short = 1e3 * np.array(depths), 1e3 * np.array(shortages)
    print(f"{len(cut)} windows whose samples are clear: {(cut > 0.01).sum()} cut into a disc,")
    print(f"  deepest {cut.max():.1f} mm, median of those {np.median(cut[cut > 0.01]):.2f} mm")
    print(
        f"{len(short)} segments: 50 chords fall short by {np.median(short):.2f} mm in the median,"
    )
    print(f"  {short.max():.1f} mm at most")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
