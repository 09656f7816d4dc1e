"""Changes that a command makes to all of its fields: grown obstacles and other limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from ferguson_gym.runtime.arrays import finite, truncate_repr
from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import Limits, check_names

_UNITS = {"slowest": " m per unit t", "segments": ""}
"""Units of limits other than metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldChanges:
    """Changes to a field before it is flown; false if there are none.

    Raises:
        ValueError: metres that are negative or not finite, a name that is not a limit's, a limit
            that is given twice or is not a number.
    """

    inflate: float = 0.0
    """By how much all obstacles are grown [m]."""
    limits: tuple[tuple[str, float], ...] = ()
    """Names and values of limits, as `Field.with_limits` takes them; kept in the order of
    `Limits`."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "inflate", float(finite("inflate", self.inflate, ())))
        if self.inflate < 0.0:
            raise ValueError(f"obstacles are inflated by 0 m or more, got {self.inflate:g} m")
        names = [name for name, _ in self.limits]
        check_names(names)
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"limit {name} is given twice")
        given = {name: float(finite(f"limit {name}", value, ())) for name, value in self.limits}
        ordered = tuple((one.name, given[one.name]) for one in fields(Limits) if one.name in given)
        object.__setattr__(self, "limits", ordered)

    def __bool__(self) -> bool:
        return bool(self.inflate or self.limits)

    def apply(self, field: Field) -> Field:
        """The changed field, of the same name.

        Raises:
            ValueError: limits that contradict each other or those of the field, or as
                `Field.inflated`; the message names the field.
        """
        try:
            limited = field.with_limits(**dict(self.limits))
        except ValueError as error:
            raise ValueError(f"{field.name}, with {self._of_limits()}: {error}") from None
        return limited.inflated(self.inflate)

    def __str__(self) -> str:
        """For people, for example `obstacles inflated by 0.3 m, longest 30 m`."""
        grown = [f"obstacles inflated by {self.inflate:g} m"] if self.inflate else []
        return ", ".join([*grown, *([self._of_limits()] if self.limits else [])])

    def _of_limits(self) -> str:
        return ", ".join(f"{name} {value:g}{_UNITS.get(name, ' m')}" for name, value in self.limits)

    def words(self) -> Iterator[str]:
        """The options of a command that makes these changes."""
        if self.inflate:
            yield from ("--inflate", _exact(self.inflate))
        for name, value in self.limits:
            yield from ("--limit", f"{name}={_exact(value)}")

    def as_json(self) -> dict[str, Any]:
        """JSON values that identify the changes, for the configuration of results.

        Limits appear only if some change: configurations that were written before fields could have
        other limits stay the same.
        """
        return {"inflate": self.inflate, **({"limits": dict(self.limits)} if self.limits else {})}

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> FieldChanges:
        """Changes from a mapping that holds what `as_json` gave, and maybe other keys.

        Raises:
            ValueError: as the class, or limits that are no mapping.
        """
        limits = values.get("limits", {})
        if not isinstance(limits, Mapping):
            raise ValueError(f"limits are names with values, got {truncate_repr(limits)}")
        return cls(inflate=values.get("inflate", 0.0), limits=tuple(limits.items()))


UNCHANGED = FieldChanges()


def _exact(value: float) -> str:
    return repr(value).removesuffix(".0")
