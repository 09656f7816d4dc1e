"""The vector environment as a `VecEnv` of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from ferguson_gym.simulation.settings import check_arguments
from ferguson_gym.simulation.step_buffers import INFOS
from ferguson_gym.spaces import as_actions, known_options
from ferguson_gym.vector_environment import VectorObstacleField

_EACH = ("field", "state", "control", "refused")
"""Methods of the vector environment that take the number of an environment."""

Observations = NDArray[np.float32] | dict[str, NDArray[np.float32]]


class ObstacleFieldVecEnv(VecEnv):
    """N environments `ferguson/ObstacleField-v0` for Stable-Baselines3, stepped by compiled code.

    Returns the same numbers as a `DummyVecEnv` of scalar environments with the same seeds. An
    environment is reset in the step that ends its flight: the last observation is
    `infos[i]["terminal_observation"]`, and `infos[i]["TimeLimit.truncated"]` is true for a flight
    that was truncated after the last segment rather than terminated.

    Args:
        num_envs: N.
        flat: observations as one vector, in the order of `gymnasium.spaces.flatten`, instead
            of a dictionary.
        arguments: of the environment.

    Raises:
        ValueError, TypeError: as the vector environment.
    """

    def __init__(self, num_envs: int, *, flat: bool = False, **arguments: Any) -> None:
        mode = AutoresetMode.SAME_STEP
        check_arguments(arguments, type(self).__name__, "num_envs", "flat", "render_mode")
        self.envs = VectorObstacleField(num_envs, autoreset_mode=mode, **arguments)
        self._flat = flat
        self.render_mode = self.envs.render_mode
        single = self.envs.single_observation_space
        self._keys = list(single.spaces) if isinstance(single, spaces.Dict) else []
        shown = spaces.flatten_space(single) if flat else single
        super().__init__(num_envs, shown, self.envs.single_action_space)

    def reset(self) -> Observations:
        """Start all flights, with the seeds and options set before; these apply only once.

        Raises:
            TypeError, ValueError: as the vector environment.
        """
        fields = [known_options(options, "field").get("field") for options in self._options]
        observation, infos = self.envs.reset(seed=self._seeds, options={"field": fields})
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = _rows([infos[key] for key in INFOS])
        return self._laid_out(observation)

    def step_async(self, actions: NDArray[np.floating[Any]]) -> None:
        """Keep the actions (N, 4) for `step_wait`."""
        self._actions = as_actions(actions, (self.num_envs, 4))

    def step_wait(
        self,
    ) -> tuple[Observations, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Fly one segment in each environment."""
        observation, reward, terminated, truncated, infos = self.envs.step(self._actions)
        done = terminated | truncated
        # infos of the flights that ended, not of those that were started in their place
        columns = [infos[key] for key in INFOS]
        if done.any():
            begun, final = _rows(columns), infos["final_info"]
            for i in np.flatnonzero(done).tolist():
                self.reset_infos[i] = begun[i]
            columns = [
                np.where(done, final[key], column)
                for key, column in zip(INFOS, columns, strict=True)
            ]
        reports = _rows(columns)
        for report, late in zip(reports, (truncated & ~terminated).tolist(), strict=True):
            report["TimeLimit.truncated"] = late
        for i in np.flatnonzero(done).tolist():
            last = infos["final_obs"][i]
            reports[i]["terminal_observation"] = (
                np.concatenate([last[key] for key in self._keys]) if self._flat else last
            )
        return self._laid_out(observation), reward.astype(np.float32), done, reports

    def _laid_out(self, observation: dict[str, NDArray[np.float32]]) -> Observations:
        if not self._flat:
            return observation
        return np.concatenate([observation[key] for key in self._keys], axis=1)

    def close(self) -> None:
        """Release the resources of rendering."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """An image of each flight, in render mode rgb_array."""
        return list(self.envs.render() or [])

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, as single environments have it."""
        chosen = list(self._get_indices(indices))
        if attr_name in ("observation_space", "action_space"):
            return [getattr(self, attr_name)] * len(chosen)
        value = getattr(self.envs, attr_name)
        if attr_name in _EACH:
            return [value(i) for i in chosen]
        if attr_name in ("np_random", "np_random_seed"):
            if not value:
                raise RuntimeError("nothing is seeded yet: call reset() first")
            return [value[i] for i in chosen]
        return [value] * len(chosen)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused, since the arguments of environments are fixed.

        Raises:
            AttributeError: always.
        """
        raise AttributeError(f"{attr_name} cannot be set; make a new {type(self).__name__}")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method (`field`, `state`, `control` or `refused`) for environments.

        Raises:
            AttributeError: any other method.
        """
        if method_name not in _EACH:
            raise AttributeError(
                f"no method {method_name!r} of single environments; methods are {', '.join(_EACH)}"
            )
        method = getattr(self.envs, method_name)
        return [method(i, *method_args, **method_kwargs) for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Always false: there are no single environments to wrap."""
        return [False] * len(list(self._get_indices(indices)))

    def _get_indices(self, indices: int | Iterable[int] | None) -> Iterable[int]:
        chosen: Iterable[int] = super()._get_indices(indices)
        return chosen


def _rows(columns: list[NDArray[Any]]) -> list[dict[str, Any]]:
    """The info of each environment, from arrays over all environments."""
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return [dict(zip(INFOS, row, strict=True)) for row in rows]
