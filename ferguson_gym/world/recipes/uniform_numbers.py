"""Random numbers one by one, from a stream whose numbers never change."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np


def uniform_numbers(stream: np.random.RandomState) -> Iterator[float]:
    """Numbers in [0, 1) without end, drawn many at a time, which is faster."""
    while True:
        yield from stream.random_sample(512).tolist()
