"""How long anytime planners search: a number of something that is counted, or seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Iterations:
    """So many rounds of the search: the same path on every machine.

    Raises:
        ValueError: fewer than one.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"a budget is at least 1 iteration, got {self.count}")


@dataclass(frozen=True, slots=True)
class Evaluations:
    """So many evaluations of an objective: the same path on every machine.

    Raises:
        ValueError: fewer than one.
    """

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"a budget is at least 1 evaluation, got {self.count}")


@dataclass(frozen=True, slots=True)
class Seconds:
    """So much time by the clock: what is found depends on the machine.

    Raises:
        ValueError: none, or endless.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not 0.0 < self.seconds < math.inf:
            raise ValueError(f"a budget is a number of seconds above 0, got {self.seconds}")
