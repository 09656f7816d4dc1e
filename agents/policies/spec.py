"""The grammar of policy names, which are parsed only here, by `PolicySpec.parse`.

| name | policy |
| --- | --- |
| `PLANNER+OPTION+...` | a planner; its options are those of `planners.registry.PlannerSpec` |
| `PLANNER+...+from=POLICY` | a planner whose initial guesses are the segments of another policy |
| `AGENT` | a shipped agent by name, or the path of a trained one; `best` is the best shipped one |
| `AGENT+tries=N` | an agent that simulates N rollouts and flies the shortest |
| `AGENT[+tries=N]+sensing=METRES` | an agent that knows only the obstacles within a range |
| `POLICY+shield` | a policy whose segments a planner replaces if they fail a check |
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from agents.models import shipped_agents
from ferguson_gym.world import Field
from planners.registry import PLANNERS, PlannerSpec, parse_metres
from planners.wrappers.limited_sensing import check_range

_SHIELD, _FROM, _TRIES, _SENSING = "+shield", "+from=", "+tries=", "+sensing="


@dataclass(frozen=True, slots=True, kw_only=True)
class PolicySpec:
    """The parts of a policy's name; `str` gives the canonical name.

    Example:
        >>> spec = PolicySpec.parse("multi-start+sensing=20.0+backtrack+from=pursuit+shield")
        >>> spec.is_planner, spec.shield, str(spec.start_from)
        (True, True, 'pursuit')
        >>> str(spec)
        'multi-start+backtrack+sensing=20+from=pursuit+shield'
    """

    planner: PlannerSpec | None = None
    """The planner and its options; None: the policy is an agent."""
    start_from: PolicySpec | None = None
    """The policy that the planner's windows start from."""
    agent: str = ""
    """Name of a shipped agent or path of a trained one; empty: the policy is a planner."""
    tries: int | None = None
    """Number of flights that the agent simulates before it flies; None: it simulates none."""
    sensing: float | None = None
    """Range within which obstacles become known to the agent [m]; None: it knows all."""
    shield: bool = False
    """Whether the policy flies under a shield."""

    @classmethod
    def parse(cls, text: str) -> PolicySpec:
        """Split a policy's name into its parts.

        A final `+shield` belongs to the whole policy, also behind `+from=POLICY`. Whether an
        agent exists is checked when the policy is made.

        Raises:
            ValueError: an option is unknown, repeated or has a value of another kind; the policy
                has two shields; the file that names the best agent is damaged.
        """
        plain = text.removesuffix(_SHIELD)
        if plain.endswith(_SHIELD):
            raise ValueError(f"policy {plain!r} has a shield already")
        is_planner = plain.partition("+")[0] in PLANNERS
        spec = cls.parse_planner(plain) if is_planner else cls._parse_agent(plain)
        return replace(spec, shield=plain != text)

    @classmethod
    def parse_planner(cls, text: str) -> PolicySpec:
        """Split a planner's name into its parts: no shield, but perhaps `+from=POLICY`.

        Raises:
            ValueError: as `parse`, or the planner is unknown.
        """
        plain, found, policy = text.partition(_FROM)
        start_from = cls.parse(policy) if found else None
        return cls(planner=PlannerSpec.parse(plain), start_from=start_from)

    @classmethod
    def _parse_agent(cls, text: str) -> PolicySpec:
        plain, limited, metres = text.partition(_SENSING)
        name, found, tries = plain.partition(_TRIES)
        if found and not (tries.isascii() and tries.isdecimal()):
            raise ValueError(f"policy {text!r}: need an integer >= 1 after {_TRIES}, got {tries!r}")
        best = shipped_agents.best() if name == shipped_agents.BEST else None
        spec = cls(agent=name) if best is None else cls._parse_agent(best)
        if found:
            spec = replace(spec, tries=int(tries))
        return replace(spec, sensing=parse_metres("sensing", metres)) if limited else spec

    def with_options(self, start_from: str | None = None, **options: Any) -> PolicySpec:
        """This planner with options of `planners.registry.PlannerSpec`; None or False: unchanged.

        Args:
            start_from: name of the policy that windows start from.
            options: by their names.

        Raises:
            ValueError: the name carries one of them already, or as `parse`.
        """
        assert self.planner is not None
        spec = replace(self, planner=self.planner.with_options(**options))
        if start_from is None:
            return spec
        if self.start_from is not None:
            raise ValueError(f"planner {str(self)!r} carries an option twice: from")
        return replace(spec, start_from=PolicySpec.parse(start_from))

    def check(self, field: Field) -> None:
        """Refuse options that do not fit the limits of a field.

        Raises:
            ValueError: as `planners.registry.PlannerSpec.check`.
        """
        if self.planner is not None:
            self.planner.check(field)
        if self.sensing is not None:
            check_range(self.sensing, field)

    @property
    def is_planner(self) -> bool:
        """Whether the policy is a planner, not an agent."""
        return self.planner is not None

    @property
    def agents(self) -> tuple[str, ...]:
        """Names or paths of the agents that the policy flies with, at most one."""
        if self.start_from is not None:
            return self.start_from.agents
        return () if self.is_planner else (self.agent,)

    def __str__(self) -> str:
        """The canonical name."""
        name = self.agent if self.planner is None else str(self.planner)
        if self.start_from is not None:
            name += f"{_FROM}{self.start_from}"
        if self.tries is not None:
            name += f"{_TRIES}{self.tries}"
        if self.sensing is not None:
            name += f"{_SENSING}{str(self.sensing).removesuffix('.0')}"
        return name + _SHIELD * self.shield
