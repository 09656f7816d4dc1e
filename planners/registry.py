"""Planners by name, and the options that a name may carry."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from ferguson_gym.runtime import truncate_repr
from ferguson_gym.runtime.suggestions import did_you_mean
from ferguson_gym.world import Field
from ferguson_gym.world.field_names import as_field
from ferguson_gym.world.turn_radius import check_turn_radius
from planners.constructors import OWN
from planners.deadline import check_deadline, plan_within
from planners.interface import (
    Plan,
    Planner,
    Replanner,
    initial_state,
    knowledge_of,
)
from planners.optimization import Proposer
from planners.reachability import explained, unreachable_plan
from planners.receding_horizon import Guided, RecedingHorizon
from planners.wrappers import Backtracking, Margin, Sensing
from planners.wrappers.limited_sensing import check_range

PLANNERS: dict[str, Callable[[], Planner]] = dict(OWN)
"""Constructors of planners by name; they raise a ValueError if a library is not installed."""
GROUP = "ferguson.planners"
"""Entry points of this group in installed packages name further planners."""


def register(name: str, constructor: Callable[[], Planner]) -> None:
    """Give a planner a name that all commands of this process know, and its worker processes.

    A package makes a name known to every process instead, by an entry point of the group
    `ferguson.planners` that leads to such a constructor.

    Args:
        name: letters, digits, `.`, `_` and `-`.
        constructor: makes the planner without arguments, for example its class.

    Raises:
        ValueError: a name with other characters, or of another planner; no constructor.
    """
    if re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name) is None:
        raise ValueError(
            f"a planner's name has letters, digits, '.', '_' and '-' only, got {name!r}"
        )
    given: object = constructor
    if not callable(given):
        raise ValueError(
            f"planner {name!r} needs a class or a function that makes it, "
            f"got {truncate_repr(given)}"
        )
    if PLANNERS.get(name, constructor) != constructor:
        raise ValueError(f"there is a planner {name!r} already; choose another name")
    PLANNERS[name] = constructor


def registered() -> dict[str, Callable[[], Planner]]:
    """Constructors by name that were added in this process, without those of entry points."""
    return {
        name: constructor
        for name, constructor in PLANNERS.items()
        if name not in OWN and not isinstance(constructor, _Installed)
    }


@dataclass(frozen=True, slots=True)
class _Installed:
    """Constructor of an installed package's planner, which imports the package when called."""

    entry: EntryPoint

    def __call__(self) -> Planner:
        try:
            constructor = self.entry.load()
        except Exception as error:  # whatever the package raises when it is imported
            raise ValueError(
                f"planner {self.entry.name!r} cannot be imported from {self.entry.value}: {error}"
            ) from error
        if not callable(constructor):
            raise ValueError(
                f"planner {self.entry.name!r}: {self.entry.value} is not a class or a function "
                "that makes a planner"
            )
        planner: Planner = constructor()
        return planner


def _register_installed() -> None:
    """Register the planners of installed packages; one that cannot be is a warning."""
    for entry in entry_points(group=GROUP):
        try:
            register(entry.name, _Installed(entry))
        except ValueError as error:
            warnings.warn(f"entry point of {entry.value}: {error}", stacklevel=2)


_register_installed()
OPTIONS = "NAME+turn=METRES, NAME+backtrack, NAME+margin=METRES, NAME+sensing=METRES or several"
"""The options that a planner's name may carry, as shown to users."""
_METRES = {"turn": "a turn radius", "margin": "a margin", "sensing": "a sensing range"}
"""Options with a value in metres, and what each sets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerSpec:
    """The parts of a planner's name: the planner and its options.

    The options are applied from the planner outwards, in the order of the fields: the margin also
    applies to the backtracking planner, and both use only sensed obstacles.

    Example:
        >>> spec = PlannerSpec.parse("multi-start+sensing=20.0+backtrack")
        >>> spec.sensing, str(spec)
        (20.0, 'multi-start+backtrack+sensing=20')
    """

    name: str
    """A key of `PLANNERS`."""
    turn: float | None = None
    """Turn radius to keep [m]."""
    backtrack: bool = False
    """Whether `guided` takes over in dead ends."""
    margin: float | None = None
    """Distance to keep from obstacles where possible [m]."""
    sensing: float | None = None
    """Range within which obstacles become known [m]."""

    @classmethod
    def parse(cls, text: str) -> PlannerSpec:
        """Split a planner's name into its parts.

        Raises:
            ValueError: the planner or an option is unknown, an option is repeated, or a value is
                not a number.
        """
        name, *options = text.split("+")
        if name not in PLANNERS:
            near = did_you_mean(name, PLANNERS)
            raise ValueError(f"unknown planner {name!r}{near}; planners are {', '.join(PLANNERS)}")
        spec = cls(name=name)
        for option in options:
            label, _, value = option.partition("=")
            if label in _METRES:
                spec = spec.with_options(**{label: parse_metres(label, value)})
            elif option == "backtrack":
                spec = spec.with_options(backtrack=True)
            else:
                near = did_you_mean(label, [*_METRES, "backtrack"])
                raise ValueError(
                    f"unknown option {option!r} of planner {name!r}{near}; need {OPTIONS}"
                )
        return spec

    def with_options(self, **options: Any) -> PlannerSpec:
        """This planner with further options; those that are None or False change nothing.

        Raises:
            ValueError: one of the options is already set.
        """
        added = {label: value for label, value in options.items() if _is_set(value)}
        for label in added:
            if _is_set(getattr(self, label)):
                raise ValueError(f"planner {str(self)!r} carries an option twice: {label}")
        return replace(self, **added)

    def __str__(self) -> str:
        """The canonical name."""
        return self.name + "".join(
            f"+{label}" if value is True else f"+{label}={str(value).removesuffix('.0')}"
            for label in ("turn", "backtrack", "margin", "sensing")
            if _is_set(value := getattr(self, label))
        )

    def make(self) -> Planner:
        """The planner itself.

        Raises:
            ValueError: its library is not installed, or an option does not fit the planner or has
                a value out of its range.
        """
        planner = PLANNERS[self.name]()
        if not callable(getattr(planner, "plan", None)):
            raise ValueError(
                f"planner {self.name!r} is a {type(planner).__name__} without the method "
                "plan(field, state, seed)"
            )
        knowledge_of(planner)  # refuses a wrong statement before anything is flown
        if self.turn is not None:
            if self.backtrack or self.sensing is not None:
                raise ValueError(
                    f"planner {str(self)!r}: a turn radius is not kept where a planner backtracks "
                    "or senses; leave one out"
                )
            if not isinstance(planner, Guided):
                raise ValueError(f"planner {self.name!r} keeps no turn radius; guided does")
            planner = replace(planner, min_turn_radius=self.turn)
        if self.backtrack:
            planner = Backtracking(planner=self._replanner(planner, "backtrack"), guide=Guided())
        if self.margin is not None:
            planner = Margin(planner=self._replanner(planner, "margin"), margin=self.margin)
        if self.sensing is not None:
            planner = Sensing(planner=self._replanner(planner, "sensing"), reach=self.sensing)
        return planner

    def check(self, field: Field) -> None:
        """Refuse options that do not fit the limits of a field.

        Raises:
            ValueError: a sensing range below the longest segment, or a turn radius that is not
                above the tolerance.
        """
        if self.sensing is not None:
            check_range(self.sensing, field)
        if self.turn is not None:
            check_turn_radius(self.turn, field.limits.tolerance)

    def _replanner(self, planner: Planner, option: str) -> Replanner:
        if not isinstance(planner, Replanner):
            raise ValueError(
                f"planner {self.name!r} plans its whole path at once and has no option {option}; "
                "single-start, multi-start, guided and pursuit do"
            )
        return planner


def make(name: str) -> Planner:
    """The planner of this name, with the options that it carries.

    `guided+turn=3` keeps a turn radius of 3 m; `guided+sensing=20` uses the obstacles within 20 m
    of the path flown; `multi-start+backtrack` lets `guided` take over in dead ends;
    `guided+margin=0.5` keeps half a metre from obstacles where it can.

    Raises:
        ValueError: the planner or an option is unknown, the planner's library is not installed,
            or an option does not fit the planner or has a value out of its range.

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> from planners.interface import initial_state
        >>> field = get_field("sparse/train:0")
        >>> plan = make("shortest").plan(field, initial_state(field), seed=0)
        >>> plan.status.sentence
        'found a feasible path to the goal'
    """
    return PlannerSpec.parse(name).make()


def plan(
    field: Field | str,
    planner: Planner | str = "guided",
    seed: int = 0,
    *,
    deadline: float | None = None,
) -> Plan:
    """Plan a field from its start.

    Args:
        field: a planar field, or the name of one, for example a JSON file.
        planner: a planner, or the name of one with its options.
        seed: of the planner's random numbers.
        deadline: time after which the plan ends with the best certified path so far [s], as
            `planners.deadline.plan_within` explains; None: no limit.

    Returns:
        The plan; its `path` is None if no path to the goal was found. Its status says so if no
        planner could find one.

    Raises:
        ValueError: the field or the planner is unknown, the planner cannot stop at a deadline, or
            as `make` and `Planner.plan`.
        OSError: the field's file cannot be read.

    Example:
        >>> found = plan("paper:2", "shortest")
        >>> found.path.sample(number=3).position.round().tolist()
        [[0.0, 0.0], [58.0, 43.0], [100.0, 100.0]]
    """
    field = as_field(field)
    state = initial_state(field)
    made = make(planner) if isinstance(planner, str) else planner
    if deadline is not None:
        check_deadline(made, planner if isinstance(planner, str) else None)
    if (unreachable := unreachable_plan(field, exact=False)) is not None:
        return unreachable
    if deadline is not None:
        return explained(plan_within(made, field, state, seed, deadline), field)
    return explained(made.plan(field, state, seed), field)


def starting_from(planner: Planner, proposer: Proposer, name: str) -> Planner:
    """A planner whose windows start from proposals; `name` is used in error messages.

    Single-start and multi-start take them, with or without backtracking and limited sensing.

    Raises:
        ValueError: the planner takes no starts.
    """
    if isinstance(planner, RecedingHorizon):
        return replace(planner, proposer=proposer)
    if isinstance(planner, Sensing | Backtracking):
        inner = starting_from(planner.planner, proposer, name)
        assert isinstance(inner, Replanner)
        return replace(planner, planner=inner)
    raise ValueError(
        f"planner {name!r} takes no starts from an agent; single-start and multi-start do"
    )


def _is_set(value: object) -> bool:
    return value is not None and value is not False


def parse_metres(label: str, value: str) -> float:
    """The value of an option in metres.

    Raises:
        ValueError: not a number.
    """
    try:
        return float(value)
    except ValueError:
        raise ValueError(f"{_METRES[label]} is a number of metres, got {value!r}") from None
