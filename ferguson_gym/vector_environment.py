"""Many flights at once: the native vector environment of `ferguson/ObstacleField-v0`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from ferguson_gym.arguments import VectorArguments
from ferguson_gym.runtime.arrays import Array, truncate_repr
from ferguson_gym.simulation.batch_simulator import NOT_STARTED, BatchSimulator
from ferguson_gym.simulation.observations import FlatObservation, Observation, entries_of
from ferguson_gym.simulation.settings import Settings, settings_of
from ferguson_gym.simulation.step_buffers import (
    DISABLED,
    NEXT_STEP,
    SAME_STEP,
    Flags,
    Records,
)
from ferguson_gym.spaces import (
    action_space,
    as_actions,
    as_seed,
    known_options,
    observation_space,
)
from ferguson_gym.world.actions import Action
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import as_field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State

_MODES = {
    AutoresetMode.DISABLED: DISABLED,
    AutoresetMode.NEXT_STEP: NEXT_STEP,
    AutoresetMode.SAME_STEP: SAME_STEP,
}
_NO_LIMIT = -1
"""What Gymnasium, beside None, takes for no limit of steps."""

MOST = 10_000_000
"""Environments made at once; these would take some 50 GB."""


class VectorObstacleField(VectorArguments, VectorEnv[Any, Action, Array]):
    """N independent environments `ferguson/ObstacleField-v0`, stepped together by compiled code.

    Each returns exactly the numbers of the scalar environment
    (`ferguson_gym.environment.ObstacleField`, which specifies observations, actions and reward)
    with the same seed; nothing depends on N or on the number of threads.

    ```python
    envs = gym.make_vec("ferguson/ObstacleField-v0", num_envs=256)
    ```

    ## Autoreset
    `autoreset_mode`, an argument of this environment alone, is an `AutoresetMode` or its value.

    - "NextStep" (the default): after an episode of an environment ends, the next step ignores that
      environment's action, which must be valid, resets the environment and returns reward 0.
    - "SameStep": the step that ends an episode already returns the first observation of the next
      one; `info["final_obs"]` and `info["final_info"]` hold the last ones of the ended episode.
    - "Disabled": `reset(options={"reset_mask": mask})` resets the chosen environments; a step while
      any episode is over is an error.

    ## Seeds and fields
    `reset(seed=s)` gives environment i the seed s + i; `reset(seed=[...])` gives each its own, and
    None keeps an environment's random stream. `options={"field": ...}` takes a field or its name
    for all, or a list with one for each environment; None draws a field.

    ## Changes between flights
    `set_attr("obstacles", 20)` changes an argument of all environments, each from its next reset
    on; a list has a value for each. `set_arguments` changes several at once, and
    `reset(options={"obstacles": 20})` those of the environments that it resets. `get_attr` returns
    the values.

    ## Info
    The scalar environment's keys as arrays (N,), each with a boolean mask `_key` of the entries
    that are set, as in Gymnasium; the other entries are zero.

    ## Spec
    `envs.spec.max_episode_steps` is the number of segments. The argument `max_episode_steps`, which
    `gym.make_vec` passes on from a spec, lowers `segments` to this number if that is larger.

    Raises:
        ValueError: as the scalar environment; num_envs < 1; an unknown autoreset mode.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium declares it so)
        "render_modes": ["rgb_array"],
        "render_fps": 4,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        max_episode_steps: int | None = None,
        **arguments: Any,
    ) -> None:
        own = ("num_envs", "autoreset_mode", "render_mode", "max_episode_steps")
        settings = settings_of(arguments, type(self).__name__, *own)
        settings = _limited(settings, max_episode_steps)
        if not isinstance(num_envs, (int, np.integer)) or num_envs is True or num_envs < 1:
            raise ValueError(f"num_envs must be an integer >= 1, got {truncate_repr(num_envs)}")
        if num_envs > MOST:
            raise ValueError(
                f"at most {MOST} environments are made at once, got {truncate_repr(num_envs)}"
            )
        if render_mode not in (None, "rgb_array"):
            raise ValueError(
                f"unknown render mode {truncate_repr(render_mode)}; "
                "many environments know rgb_array only"
            )
        try:
            self.autoreset_mode = AutoresetMode(autoreset_mode)
        except (ValueError, TypeError):
            modes = ", ".join(mode.value for mode in AutoresetMode)
            raise ValueError(
                f"unknown autoreset mode {truncate_repr(autoreset_mode)}; modes are {modes}"
            ) from None
        self.num_envs, self.render_mode = num_envs, render_mode
        self.metadata = {**type(self).metadata, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = action_space()
        self.single_observation_space = observation_space(settings)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._simulator = BatchSimulator(settings, num_envs, _MODES[self.autoreset_mode])
        self._sizes, self._flat = settings.layout.entries(), settings.flat
        self._all = np.ones(num_envs, np.bool_)
        self._streams: list[np.random.Generator] = []
        self._seeds: list[int] = []
        self._begun = False
        self._spec: EnvSpec | None = None
        self._viewer: Any = None

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random stream of each environment, seeded at random before the first reset."""
        self._seed_streams()
        return tuple(self._streams)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's random stream, drawn before the first reset."""
        self._seed_streams()
        return tuple(self._seeds)

    def _seed_streams(self) -> None:
        if not self._streams:
            drawn = [seeding.np_random() for _ in range(self.num_envs)]
            self._streams, self._seeds = [one for one, _ in drawn], [seed for _, seed in drawn]

    def field(self, index: int) -> Field:
        """The field that an environment flies.

        Raises:
            RuntimeError: before the first reset.
        """
        self._started()
        return self._simulator.field(index)

    def state(self, index: int) -> State:
        """The state of an environment's vehicle in double precision; observations are rounded.

        Raises:
            RuntimeError: before the first reset.
        """
        self._started()
        return self._simulator.state(index)

    def _started(self) -> None:
        if not self._begun:
            raise RuntimeError("no fields yet: call reset() first")

    def control(self, index: int) -> Array:
        """Segments (n, 4, 2) flown so far in an environment; empty before a reset."""
        return self._simulator.control(index)

    def refused(self, index: int) -> Array | None:
        """The segment (4, 2) that was refused and so ended an environment's flight, if one was."""
        return self._simulator.refused(index)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start flights, all or those of `options["reset_mask"]`.

        Raises:
            ValueError: lists of another length than N; unknown options; a bad value of an argument;
                a mask of another type
                or shape, or without a True; a field of another type, an unknown name, a field
                that is not planar or has too many obstacles; or a seed that is not an
                integer from 0 to 2**63 - 1.
        """
        asked_for, arguments = known_options(options, "field", "reset_mask")
        chosen = self._mask(asked_for.get("reset_mask"))
        fields = self._fields(asked_for.get("field"))
        seeds = self._seeds_of(seed)
        if not chosen.all() and (self._simulator.outcome[~chosen] == NOT_STARTED).any():
            raise ValueError("the first reset starts every environment: leave reset_mask out")
        renewed = chosen & np.array([one is not None for one in seeds])
        streams, drawn_from = list(self._streams), list(self._seeds)
        if not streams:
            streams, drawn_from = [np.random.default_rng(0)] * self.num_envs, [0] * self.num_envs
            renewed = np.ones(self.num_envs, np.bool_)
        for i in np.flatnonzero(renewed).tolist():
            streams[i], drawn_from[i] = seeding.np_random(seeds[i])
        asked = [
            given if given is not None else one for given, one in zip(fields, seeds, strict=True)
        ]
        changes = self._changed(np.flatnonzero(chosen).tolist() if arguments else (), arguments)
        self._simulator.reset(chosen, asked, streams, renewed, changes)
        if arguments:
            self.spec = self._spec
        self._streams, self._seeds, self._begun = streams, drawn_from, True
        reports = self._simulator.reports
        if not chosen.all():
            reports = reports.copy()
            reports[~chosen] = 0  # as Gymnasium has it
        return self._observations(), self._infos(reports, chosen)

    def _mask(self, mask: object) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            raise ValueError("options['reset_mask'] must be a NumPy array of bool")
        if mask.shape != (self.num_envs,):
            raise ValueError(
                f"options['reset_mask'] must have shape ({self.num_envs},), got {mask.shape}"
            )
        if not mask.any():
            raise ValueError("options['reset_mask'] chooses no environment")
        return mask

    def _fields(self, given: Any) -> list[Field | None]:
        if isinstance(given, (list, tuple)):
            if len(given) != self.num_envs:
                raise ValueError(
                    f"options['field'] must be one field or {self.num_envs}, got {len(given)}"
                )
            return [None if one is None else as_field(one) for one in given]
        return [None if given is None else as_field(given)] * self.num_envs

    def _seeds_of(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        given: Any = seed
        if isinstance(given, np.ndarray):
            given = given.tolist()
        if not isinstance(given, Sequence) or isinstance(given, (str, bytes)):
            first = as_seed(given)
            assert first is not None
            return [as_seed(first + i) for i in range(self.num_envs)]
        each = list(given)
        if len(each) != self.num_envs:
            raise ValueError(f"need one seed or {self.num_envs}, got {len(each)}")
        return [as_seed(one) for one in each]

    def step(  # type: ignore[override]
        self, actions: Action
    ) -> tuple[Any, Array, Flags, Flags, dict[str, Any]]:
        """Fly one segment in each environment, or reset it; see the class.

        Args:
            actions: (N, 4) in [-1, 1].

        Raises:
            ValueError: actions of another shape, not finite or outside [-1, 1].
            RuntimeError: no reset yet; autoreset is disabled and a flight is over.
        """
        outcome = self._simulator.outcome
        self._started()
        if self.autoreset_mode is AutoresetMode.DISABLED and outcome.any():
            over = np.flatnonzero(outcome)
            raise RuntimeError(
                f"flights are over in environments {over[:10].tolist()}"
                f"{' and others' if len(over) > 10 else ''}: "
                "call reset(options={'reset_mask': mask}) for them first"
            )
        self._simulator.step(as_actions(actions, (self.num_envs, 4)), self._streams)
        reports = self._simulator.reports
        terminated, truncated = reports["terminated"].copy(), reports["truncated"].copy()
        infos = self._infos(reports, self._all)
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            ended = terminated | truncated
            if ended.any():
                infos |= self._final(*self._simulator.final, ended)
        return self._observations(), reports["reward"].copy(), terminated, truncated, infos

    def _observations(self) -> Observation | FlatObservation:
        return self._laid_out(self._simulator.observations)

    def _laid_out(self, written: FlatObservation) -> Observation | FlatObservation:
        """A copy of observations as they are returned: by entry, or flat (N, n)."""
        if not self._flat:
            return entries_of(written.copy(), self._sizes, self.num_envs)
        entries = entries_of(written, self._sizes, self.num_envs)
        return np.concatenate(list(entries.values()), axis=1)

    def _infos(self, reports: Records, known: Flags) -> dict[str, Any]:
        infos: dict[str, Any] = {}
        for key in self.settings.infos:
            infos[key], infos[f"_{key}"] = reports[key].copy(), known.copy()
        return infos

    def _final(self, flat: FlatObservation, reports: Records, ended: Flags) -> dict[str, Any]:
        seen: Any = self._laid_out(flat)
        observations = np.full(self.num_envs, None, dtype=object)
        for i in np.flatnonzero(ended).tolist():
            observations[i] = (
                seen[i] if self._flat else {key: value[i] for key, value in seen.items()}
            )
        return {
            "final_obs": observations,
            "_final_obs": ended.copy(),
            "final_info": self._infos(reports, ended),
            "_final_info": ended.copy(),
        }

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """An image (800, 800, 3) of each environment's flight."""
        if self.render_mode is None:
            gym.logger.warn(
                "render() without a render mode; pass render_mode='rgb_array' to gym.make_vec()"
            )
            return None
        if self._viewer is None:
            from ferguson_gym.rendering.viewer import Viewer

            self._viewer = Viewer("rgb_array")
        return tuple(
            self._viewer.draw(
                self.field(i),
                self.control(i),
                self.refused(i),
                Outcome.from_code(int(self._simulator.outcome[i])),
            )
            for i in range(self.num_envs)
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


def _limited(settings: Settings, steps: int | None) -> Settings:
    """Settings with no more segments than steps.

    Raises:
        ValueError: a limit that is not an integer >= 1.
    """
    if steps is None or steps == _NO_LIMIT:
        return settings
    if type(steps) is bool or not isinstance(steps, (int, np.integer)) or steps < 1:
        raise ValueError(f"max_episode_steps must be an integer >= 1, got {truncate_repr(steps)}")
    if steps >= settings.max_segments:
        return settings
    return replace(settings, segments=int(steps))
