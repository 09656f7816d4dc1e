"""What is kept of a flight: its numbers, its path, and what tables and pictures ask for.

Records travel from worker processes, and lie on disk, as plain arrays: packs, which joined entry
by entry are packs again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.flights.flight import Flight
from agents.flights.metrics import path_share
from agents.policies.shield_decisions import ShieldDecision
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.shortest_paths.exact import gap
from ferguson_gym.world.field import Field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.paper_fields import is_from_paper
from planners.interface import Decision, WindowReport

Pack = dict[str, NDArray[Any]]
"""Records and traces of flights as arrays."""
_HANDS = tuple(ShieldDecision)
_NONE = np.empty((0, 4, 2))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Record:
    """The numbers of a flight."""

    policy: str
    field: str
    """Its name."""
    seed: int
    """Policy seed."""
    from_paper: bool
    """Whether the field is one of the paper's."""
    outcome: Outcome
    length: float
    """Length flown [m]."""
    exact_length: float | None
    """Length of the field's shortest path [m]; None if there is none."""
    clearance: float
    """Least clearance along what was flown [m]."""
    segments: int
    """Segments flown."""
    min_turn_radius: float
    """Smallest turn radius flown [m]; infinite if it never turned."""
    seconds: float
    """The whole flight; of flights in a batch, their share of it."""
    decision_seconds: Array
    """Time to choose each action, asked alone; empty where nothing was measured."""
    evaluations: int
    """Evaluations of the objective by a planner."""
    hands: Sequence[ShieldDecision]
    """In whose hands each step was; empty for policies without a shield."""

    @property
    def success(self) -> bool:
        """Whether the flight was feasible and ended on the goal."""
        return self.outcome.success

    @property
    def gap(self) -> float | None:
        """Length / exact length - 1; None unless the flight succeeded."""
        exact = self.exact_length
        return None if exact is None or not self.success else gap(self.length, exact)

    @property
    def path_share(self) -> float:
        """Its part in SPL, the mean of these over flights."""
        return float(path_share(self.success, self.length, self.exact_length))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Trace:
    """Where a flight went."""

    control: Array
    """Segments (n, 4, 2) flown, as far as it got."""
    refused: Array | None = None
    """The segment (4, 2) that ended the flight without being flown, if one did."""
    windows: Sequence[Array] = ()
    """Chains (m, 4, 2) that a planner searched for, if the flight is to be drawn."""


def record_of(flight: Flight) -> Record:
    """The numbers of a flight."""
    return Record(
        policy=flight.policy,
        field=flight.field.name,
        seed=flight.seed,
        from_paper=is_from_paper(flight.field),
        outcome=flight.outcome,
        length=flight.length,
        exact_length=flight.exact_length,
        clearance=flight.clearance,
        segments=len(flight.control),
        min_turn_radius=flight.min_turn_radius,
        seconds=flight.seconds,
        decision_seconds=np.array(flight.decision_seconds),
        evaluations=flight.evaluations,
        hands=flight.shield_decisions,
    )


def trace_of(flight: Flight, drawn: bool) -> Trace:
    """Where a flight went, with the windows if it will be drawn."""
    windows = [
        decision.chain
        for decision in (flight.decisions if drawn else ())
        if decision.chain is not None and decision.report.starts > 0
    ]
    return Trace(control=flight.control, refused=flight.refused, windows=windows)


def flight_of(record: Record, trace: Trace, field: Field) -> Flight:
    """The flight again, as far as pictures show it."""
    reports = [WindowReport(step=k, starts=1, seconds=0.0) for k in range(len(trace.windows))]
    return Flight(
        policy=record.policy,
        field=field,
        seed=record.seed,
        outcome=record.outcome,
        control=trace.control,
        refused=trace.refused,
        clearance=record.clearance,
        seconds=record.seconds,
        decision_seconds=record.decision_seconds.tolist(),
        decisions=[
            Decision(chain, report) for chain, report in zip(trace.windows, reports, strict=True)
        ],
        shield_decisions=record.hands,
    )


def pack(flown: Sequence[tuple[Record, Trace]]) -> Pack:
    """Records and traces as arrays, without the names and seeds of the flights."""
    records = [record for record, _ in flown]
    traces = [trace for _, trace in flown]
    windows = [chain for trace in traces for chain in trace.windows]
    hands = [_HANDS.index(hand) for record in records for hand in record.hands]
    exact = [math.nan if r.exact_length is None else r.exact_length for r in records]
    return {
        "outcome": np.array([record.outcome.code for record in records], np.int8),
        "from_paper": np.array([record.from_paper for record in records], np.bool_),
        "length": np.array([record.length for record in records]),
        "exact_length": np.array(exact),
        "clearance": np.array([record.clearance for record in records]),
        "min_turn_radius": np.array([record.min_turn_radius for record in records]),
        "seconds": np.array([record.seconds for record in records]),
        "evaluations": np.array([record.evaluations for record in records], np.int64),
        "decisions": np.array([len(record.decision_seconds) for record in records], np.int64),
        "decision_seconds": np.concatenate([[], *(r.decision_seconds for r in records)]),
        "hand_counts": np.array([len(record.hands) for record in records], np.int64),
        "hands": np.array(hands, np.int8),
        "segments": np.array([record.segments for record in records], np.int64),
        "control": np.concatenate([_NONE, *(trace.control for trace in traces)]),
        "refusals": np.array([trace.refused is not None for trace in traces], np.bool_),
        "refused": np.array([t.refused for t in traces if t.refused is not None]).reshape(-1, 4, 2),
        "window_counts": np.array([len(trace.windows) for trace in traces], np.int64),
        "window_segments": np.array([len(chain) for chain in windows], np.int64),
        "windows": np.concatenate([_NONE, *windows]),
    }


def join(packs: Sequence[Pack]) -> Pack:
    """One pack of the flights of several, in order."""
    return {key: np.concatenate([one[key] for one in packs]) for key in packs[0]}


def check(packed: Mapping[str, NDArray[Any]], number: int) -> None:
    """Refuse what is no pack of so many flights, before anything is taken from it.

    Raises:
        ValueError: arrays are missing, of another kind or shape, or not as long as others say.
    """
    for name, like in pack(()).items():
        if name not in packed:
            raise ValueError(f"no {name}")
        found = packed[name]
        if found.dtype.kind != like.dtype.kind or found.shape[1:] != like.shape[1:]:
            raise ValueError(f"{name} is {found.shape} of {found.dtype}")
        if found.dtype.kind == "f" and name != "exact_length" and np.isnan(found).any():
            raise ValueError(f"NaN in {name}")
    for whole, counts in _COUNTED.items():
        told = packed[counts]
        if (told < 0).any() or len(packed[whole]) != told.sum():
            raise ValueError(f"{whole} are not as many as {counts} say")
    wrong = [name for name in _EACH if len(packed[name]) != number]
    if wrong:
        raise ValueError(f"not {number} flights in {', '.join(wrong)}")
    for name, most in (("outcome", len(Outcome)), ("hands", len(_HANDS))):
        if ((packed[name] < 0) | (packed[name] >= most)).any():
            raise ValueError(f"codes of {name} that are none")


def records(packed: Mapping[str, Any], keys: Iterable[tuple[str, str, int]]) -> Iterator[Record]:
    """The records in a pack.

    Args:
        packed: what `pack` gave, or a file of it.
        keys: policy, field and seed of each flight.

    Raises:
        ValueError: not as many flights as keys.
    """
    columns = {name: packed[name].tolist() for name in _COLUMNS}
    seconds = _parts(packed["decision_seconds"], packed["decisions"])
    hands = _parts(packed["hands"], packed["hand_counts"])
    rows = zip(*columns.values(), strict=True)
    for key, row, decided, held in zip(keys, rows, seconds, hands, strict=True):
        values = dict(zip(columns, row, strict=True))
        exact = values.pop("exact_length")
        yield Record(
            policy=key[0],
            field=key[1],
            seed=key[2],
            outcome=Outcome.from_code(values.pop("outcome")),
            exact_length=None if math.isnan(exact) else exact,
            decision_seconds=decided,
            hands=[_HANDS[code] for code in held.tolist()],
            **values,
        )


_COLUMNS = (
    "outcome",
    "from_paper",
    "length",
    "exact_length",
    "clearance",
    "segments",
    "min_turn_radius",
    "seconds",
    "evaluations",
)


_EACH = (*_COLUMNS, "decisions", "hand_counts", "refusals", "window_counts")
"""Arrays with an entry for each flight."""
_COUNTED = {
    "decision_seconds": "decisions",
    "hands": "hand_counts",
    "control": "segments",
    "refused": "refusals",
    "window_segments": "window_counts",
    "windows": "window_segments",
}
"""Arrays of all flights' together, and what says how many of them are each one's."""


def traces(packed: Mapping[str, Any]) -> Iterator[Trace]:
    """The traces in a pack."""
    refused = iter(packed["refused"])
    windows = _parts(packed["windows"], packed["window_segments"])
    for control, has_refused, number in zip(
        _parts(packed["control"], packed["segments"]),
        packed["refusals"].tolist(),
        packed["window_counts"].tolist(),
        strict=True,
    ):
        yield Trace(
            control=control,
            refused=next(refused) if has_refused else None,
            windows=[next(windows) for _ in range(number)],
        )


def _parts(flat: NDArray[Any], counts: NDArray[np.int64]) -> Iterator[NDArray[Any]]:
    """Slices of an array, so many rows each."""
    last = 0
    for count in counts.tolist():
        first, last = last, last + count
        yield flat[first:last]
