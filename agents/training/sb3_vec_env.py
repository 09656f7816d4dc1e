"""The vector environment as a `VecEnv` of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from ferguson_gym.arguments import PER_ENVIRONMENT, check_changeable
from ferguson_gym.simulation.settings import check_arguments
from ferguson_gym.spaces import as_actions, known_options
from ferguson_gym.vector_environment import VectorObstacleField

Observations = NDArray[np.float32] | dict[str, NDArray[np.float32]]


class ObstacleFieldVecEnv(VecEnv):
    """N environments `ferguson/ObstacleField-v0` for Stable-Baselines3, stepped by compiled code.

    Returns the same numbers as a `DummyVecEnv` of scalar environments with the same seeds. An
    environment is reset in the step that ends its flight: the last observation is
    `infos[i]["terminal_observation"]`, and `infos[i]["TimeLimit.truncated"]` is true for a flight
    that was truncated after the last segment rather than terminated.

    Args:
        num_envs: N.
        arguments: of the environment; with `flat=True` observations are vectors.

    Raises:
        ValueError, TypeError: as the vector environment.
    """

    def __init__(self, num_envs: int, **arguments: Any) -> None:
        if isinstance(num_envs, Sequence):  # `make_vec_env` passes functions that make environments
            raise TypeError(
                f"{type(self).__name__} makes its environments itself, and make_vec_env does not "
                f"apply to it; call VecMonitor({type(self).__name__}({len(num_envs)}, **arguments))"
            )
        mode = AutoresetMode.SAME_STEP
        check_arguments(arguments, type(self).__name__, "num_envs", "render_mode")
        self.envs = VectorObstacleField(num_envs, autoreset_mode=mode, **arguments)
        self.render_mode = self.envs.render_mode
        super().__init__(
            num_envs, self.envs.single_observation_space, self.envs.single_action_space
        )

    def reset(self) -> Observations:
        """Start all flights, with the seeds and options set before; these apply only once.

        Raises:
            TypeError, ValueError: as the vector environment.
        """
        given = [known_options(options, "field") for options in self._options]
        for i, (_, arguments) in enumerate(given):
            if arguments:
                self.envs.set_arguments([i], **arguments)
        fields = [options.get("field") for options, _ in given]
        observation, infos = self.envs.reset(seed=self._seeds, options={"field": fields})
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = _rows({key: infos[key] for key in self.envs.settings.infos})
        seen: Observations = observation
        return seen

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
        columns = {key: infos[key] for key in self.envs.settings.infos}
        if done.any():
            begun, final = _rows(columns), infos["final_info"]
            for i in np.flatnonzero(done).tolist():
                self.reset_infos[i] = begun[i]
            columns = {key: np.where(done, final[key], column) for key, column in columns.items()}
        reports = _rows(columns)
        for report, late in zip(reports, (truncated & ~terminated).tolist(), strict=True):
            report["TimeLimit.truncated"] = late
        for i in np.flatnonzero(done).tolist():
            reports[i]["terminal_observation"] = infos["final_obs"][i]
        return observation, reward.astype(np.float32), done, reports

    def close(self) -> None:
        """Release the resources of rendering."""
        self.envs.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """An image of each flight, in render mode rgb_array."""
        return list(self.envs.render() or [])

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute, as single environments have it."""
        values = self.envs.get_attr(attr_name)
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Change an argument of environments from their next flights on.

        Raises:
            AttributeError: an argument that does not change between flights, or no argument.
            ValueError: a bad value.
        """
        check_changeable(attr_name, self)
        self.envs.set_arguments(self._get_indices(indices), **{attr_name: value})

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method (`set_arguments`, `field`, `state`, `control`, `refused`) for environments.

        Raises:
            AttributeError: any other method.
        """
        known = ("set_arguments", *PER_ENVIRONMENT)
        if method_name not in known:
            raise AttributeError(
                f"no method {method_name!r} of single environments; methods are {', '.join(known)}"
            )
        if method_name == "set_arguments":
            chosen = list(self._get_indices(indices))
            self.envs.set_arguments(chosen, *method_args, **method_kwargs)
            return [None] * len(chosen)
        method = getattr(self.envs, method_name)
        return [method(i, *method_args, **method_kwargs) for i in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: type[Any], indices: Any = None) -> list[bool]:
        """Always false: there are no single environments to wrap."""
        return [False] * len(list(self._get_indices(indices)))

    def _get_indices(self, indices: int | Iterable[int] | None) -> Iterable[int]:
        chosen: Iterable[int] = super()._get_indices(indices)
        return chosen


def _rows(columns: dict[str, NDArray[Any]]) -> list[dict[str, Any]]:
    """The info of each environment, from arrays over all environments."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]
