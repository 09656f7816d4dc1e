"""Time of a certified clearance, per segment and disc.

Run it from a checkout: `.venv/bin/python benchmarks/clearance.py`. 2,000 random segments of a
flight's size against the 50 discs of paper:1; median, least and greatest of 9 repeats.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ferguson_gym.curves.clearance import clearance, closest, is_clear
from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.paper_fields import paper_field

SEGMENTS, REPEATS = 2000, 9


def main() -> None:
    """Time the three questions, and plain sampling at the paper's 30 points beside them."""
    stream = np.random.default_rng(0)
    start = stream.uniform(0.0, 100.0, (SEGMENTS, 2))
    end = start + stream.uniform(-10.0, 10.0, (SEGMENTS, 2))
    slopes = stream.uniform(-12.0, 12.0, (2, SEGMENTS, 2))
    control = np.stack([start, end, *slopes], axis=1)
    discs = paper_field(1).obstacles
    assert discs.are_discs
    arrays = (control, discs.centers, discs.radii)
    t = np.linspace(0.0, 1.0, 30)
    questions: dict[str, Callable[[], object]] = {
        "is_clear": lambda: is_clear(*arrays),
        "clearance": lambda: clearance(*arrays),
        "closest": lambda: closest(*arrays),
        "30 samples": lambda: discs.signed_distance(evaluate(control, t)).min(axis=1),
    }
    print(f"{'':12}{'median':>9}{'least':>9}{'most':>9}   microseconds a segment and disc")
    for name, question in questions.items():
        question()
        seconds = []
        for _ in range(REPEATS):
            began = time.perf_counter()
            question()
            seconds.append(time.perf_counter() - began)
        micro = 1e6 * np.array(seconds) / (SEGMENTS * len(discs))
        print(f"{name:12}{np.median(micro):9.3f}{micro.min():9.3f}{micro.max():9.3f}")


if __name__ == "__main__":
    main()
