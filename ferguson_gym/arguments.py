"""Arguments of an environment as its attributes: all can be read, some change between flights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Protocol

from gymnasium.envs.registration import EnvSpec

from ferguson_gym.simulation.batch_simulator import BatchSimulator
from ferguson_gym.simulation.settings import ARGUMENTS, CHANGEABLE, Settings
from ferguson_gym.spaces import with_steps


class HasArguments(Protocol):
    """An environment with settings."""

    @property
    def settings(self) -> Settings:
        """The arguments."""

    def set_arguments(self, **arguments: Any) -> None:
        """Change arguments."""


class Argument:
    """An attribute that is an argument; setting it takes effect at the next reset.

    So `set_attr` of vector environments, which sets attributes, changes arguments.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, env: HasArguments | None, owner: type | None = None) -> Any:
        return self if env is None else getattr(env.settings, self._name)

    def __set__(self, env: HasArguments, value: Any) -> None:
        check_changeable(self._name, env)
        env.set_arguments(**{self._name: value})


def check_changeable(name: str, env: object) -> None:
    """Refuse attributes that are fixed when an environment is made.

    Raises:
        AttributeError: an argument that shapes what is returned, or no argument.
    """
    if name not in CHANGEABLE:
        raise AttributeError(
            f"{name} cannot be set; make a new {type(env).__name__} (between flights change "
            f"{', '.join(CHANGEABLE)})"
        )


class _Described:
    """Settings and spec, which environments have of one kind, scalar or vector."""

    _simulator: BatchSimulator
    _spec: EnvSpec | None

    @property
    def settings(self) -> Settings:
        """The arguments of the next flight, in a vector environment those of the first one's.

        They are those of the present flight unless they were changed.
        """
        return self._simulator.settings[0]

    @property
    def spec(self) -> EnvSpec | None:
        """How to make the environment again; `max_episode_steps` is its number of segments."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = with_steps(spec, self.settings)


class ScalarArguments(_Described):
    """Arguments of one environment as its attributes."""

    suite = Argument()
    split = Argument()
    fields = Argument()
    obstacles = Argument()
    radii = Argument()
    gate = Argument()
    segments = Argument()
    observation = Argument()
    nearest = Argument()
    focus = Argument()
    rays = Argument()
    view = Argument()
    way = Argument()
    margin = Argument()
    flat = Argument()
    progress = Argument()
    reference = Argument()
    detour = Argument()
    failure = Argument()
    capacity = Argument()

    def set_arguments(self, **arguments: Any) -> None:
        """Change arguments from the next reset on; see the class for which.

        Raises:
            ValueError: an argument that does not change between flights, or a bad value.
        """
        self._simulator.change({0: self.settings.changed(arguments)})
        self.spec = self._spec


PER_ENVIRONMENT = ("field", "state", "control", "refused")
"""Methods that take the number of an environment; they are attributes of a scalar one."""


class VectorArguments(_Described):
    """Arguments and attributes of each of N environments, named as by `SyncVectorEnv`."""

    num_envs: int

    def set_arguments(self, indices: Iterable[int] | None = None, **arguments: Any) -> None:
        """Change arguments of environments, of all by default, from their next resets on.

        Args:
            indices: numbers of the environments.
            arguments: those that may change between flights; see the scalar environment.

        Raises:
            ValueError: an argument that does not change between flights, or a bad value.
        """
        which = range(self.num_envs) if indices is None else indices
        self._change(self._changed(which, arguments))

    def _changed(self, which: Iterable[int], arguments: Mapping[str, Any]) -> dict[int, Settings]:
        """New settings of environments; those of equal ones are one object."""
        made: dict[int, Settings] = {}
        changes = {}
        for i in which:
            old = self._simulator.settings[i]
            if id(old) not in made:
                made[id(old)] = old.changed(arguments)
            changes[i] = made[id(old)]
        return changes

    def _change(self, changes: Mapping[int, Settings]) -> None:
        self._simulator.change(changes)
        self.spec = self.spec  # its number of steps may be another

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment, as scalar ones have it."""
        everyone = range(self.num_envs)
        if name in PER_ENVIRONMENT:
            return tuple(getattr(self, name)(i) for i in everyone)
        if name == "settings":
            return tuple(self._simulator.settings)
        if name in ARGUMENTS:
            return tuple(getattr(settings, name) for settings in self._simulator.settings)
        if name in ("observation_space", "action_space"):
            name = f"single_{name}"
        elif name in ("np_random", "np_random_seed"):
            return tuple(getattr(self, name))
        return (getattr(self, name),) * self.num_envs

    def set_attr(self, name: str, values: Any) -> None:
        """Change an argument of the environments from their next resets on.

        Args:
            name: of the argument.
            values: one for all environments, or a list or tuple with one for each; two numbers for
                `radii` are one value.

        Raises:
            AttributeError: an argument that does not change between flights, or no argument.
            ValueError: a list of another length than N, or a bad value.
        """
        check_changeable(name, self)
        one_for_all = not isinstance(values, (list, tuple)) or (
            name == "radii" and len(values) == 2 and not isinstance(values[0], (list, tuple))
        )
        if one_for_all:
            self.set_arguments(**{name: values})
            return
        if len(values) != self.num_envs:
            raise ValueError(f"need one {name} or {self.num_envs}, got {len(values)}")
        changes: dict[int, Settings] = {}
        for i, value in enumerate(values):
            changes |= self._changed([i], {name: value})
        self._change(changes)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method for each environment, or read an attribute, as `SyncVectorEnv` does.

        Raises:
            AttributeError: another name.
        """
        if name in PER_ENVIRONMENT:
            return tuple(getattr(self, name)(i, *args, **kwargs) for i in range(self.num_envs))
        if name == "set_arguments":
            self.set_arguments(**kwargs)
            return (None,) * self.num_envs
        return self.get_attr(name)
