"""The Gymnasium environment `ferguson/ObstacleField-v0`."""

from __future__ import annotations

from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ferguson_gym.actions import Action
from ferguson_gym.arrays import Array
from ferguson_gym.catalog import one
from ferguson_gym.fields import Field
from ferguson_gym.flight import State, Step, advance, depart
from ferguson_gym.limits import PAPER_LIMITS, Limits
from ferguson_gym.observations import COLUMNS, SHAPES, Observation, observe
from ferguson_gym.outcome import Outcome
from ferguson_gym.rewards import reward
from ferguson_gym.suites import SPLITS, SUITES, suite_field

RENDER_MODES = ("human", "rgb_array")


def observation_space(nearest: int) -> spaces.Space[Observation]:
    """The space of what `observe` returns for the K = `nearest` obstacles."""
    shapes: dict[str, tuple[int, ...]] = {key: (size,) for key, size in SHAPES.items()}
    shapes |= {"obstacles": (nearest, COLUMNS), "mask": (nearest,)}
    boxes: dict[str, spaces.Space[Any]] = {
        key: spaces.Box(-1.0, 1.0, shape, np.float32) for key, shape in shapes.items()
    }
    return cast("spaces.Space[Observation]", spaces.Dict(boxes))


class ObstacleField(gym.Env[Observation, Action]):
    """Fly from (0, 0) to (100, 100) through random discs, one smooth segment at a time.

    ## Description
    A vehicle flies in the plane along Ferguson (cubic Hermite) segments that join with one
    tangent. Each action is a segment; an episode is a flight. Every segment is certified
    along its whole length, not sampled. After Paper: Receding Horizon UAV Path Planning Via
    Gradient-Based Optimization of Ferguson Splines (2015).

    ## Action space
    `Box(-1, 1, (4,), float32)`, in the frame turned with the vehicle. Zero flies 9 m
    straight ahead. Every feasible segment has exactly one action
    (`ferguson_gym.actions.encode`).

    | entry | means | -1 | 0 | +1 |
    | --- | --- | --- | --- | --- |
    | 0 | end point, forward (with entry 1 at 0) | 15 m back | 9 m ahead | 15 m ahead |
    | 1 | end point, to the left (with entry 0 at 0) | -7.1 m | 0 m | 7.1 m |
    | 2 | end derivative, forward | -66 m | 9 m | 66 m |
    | 3 | end derivative, to the left | -66 m | 0 m | 66 m |

    Entries 0 and 1 act together: the end point is 15.001 m (q + z) / (1 + q z) with
    z = a[0] + i a[1] and q = 9 / 15.001, the real axis forward. An end point within 1 m of the goal
    is moved onto the goal.

    ## Observation space
    `Dict`, float32, all in [-1, 1]; lengths are parts of 45 m unless said otherwise and
    are clipped there.

    | key | shape | holds | range |
    | --- | --- | --- | --- |
    | vehicle | (6,) | position within the bounds, x and y | -1..1 |
    | | | heading, cosine and sine | -1..1 |
    | | | speed, part of 66 m per unit t | 0..1 |
    | | | segments left, part of 40 | 0..1 |
    | goal | (3,) | distance, part of the bounds' diagonal | 0..1 |
    | | | direction, forward and to the left, a unit vector | -1..1 |
    | obstacles | (nearest, 4) | nearest first: centre, forward and to the left | -1..1 |
    | | | radius; distance from the surface | 0..1 |
    | mask | (nearest,) | 1 for an obstacle, 0 for a row of padding | 0..1 |

    ## Reward
    `(progress - length / 2) / D`, with progress the decrease of the straight distance to
    the goal, length the segment's arc length and D the straight distance from start to
    goal (141.42 m); less 1 when the flight ends anywhere but on the goal. A step's reward
    lies between -1.16 (a longest segment straight back that is the last one) and 0.054 (the
    same straight to the goal). A successful flight
    of L metres returns 1 - L / (2 D), at most 0.5; a failure at most -0.5.

    ## Starting state
    (0, 0), with a derivative of 5 m per unit t towards the goal. `reset(seed=s)` flies the
    field `SUITE/SPLIT:s`; later resets draw seeds from `np_random`;
    `reset(options={"field": field})` flies a given field, a `Field` or its name.

    ## Termination
    The flight ends on the goal; or its segment is refused: it cuts into an obstacle, is
    longer than 15 m or shorter than 3 m, slower than 0.1 m per unit t somewhere, or leaves
    the bounds (-10, 110). A refused segment is not flown: the state stays.

    ## Truncation
    After 40 segments.

    ## Info
    | key | type | holds |
    | --- | --- | --- |
    | is_success | bool | the flight ended on the goal |
    | outcome | int | code of `ferguson_gym.outcome.Outcome`; 0 while flying |
    | path_length | float | flown so far [m] |
    | clearance | float | least clearance so far [m] |
    | segments | int | flown so far |

    ## Arguments
    `suite`: standard, sparse, dense, forest or traps. `split`: train, validation or test.
    `nearest`: number of obstacles in the observation. `render_mode`: human or rgb_array.

    ```python
    import gymnasium as gym
    import ferguson_gym

    env = gym.make("ferguson/ObstacleField-v0", suite="standard", split="train")
    ```

    ## Version history
    - v0: first version.

    Raises:
        ValueError: an unknown suite, split or render mode, or `nearest` below 1.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium declares it so)
        "render_modes": list(RENDER_MODES),
        "render_fps": 4,
    }

    def __init__(
        self,
        suite: str = "standard",
        split: str = "train",
        nearest: int = 12,
        render_mode: str | None = None,
    ) -> None:
        if suite not in SUITES:
            raise ValueError(f"unknown suite {suite!r}; suites are {', '.join(SUITES)}")
        if split not in SPLITS:
            raise ValueError(f"unknown split {split!r}; splits are {', '.join(SPLITS)}")
        if nearest < 1:
            raise ValueError(f"an observation needs nearest >= 1 obstacles, got {nearest}")
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(
                f"unknown render mode {render_mode!r}; modes are {', '.join(RENDER_MODES)}"
            )
        self.suite, self.split, self.nearest = suite, split, nearest
        self.render_mode = render_mode
        self.limits: Limits = PAPER_LIMITS
        self.action_space = spaces.Box(-1.0, 1.0, (4,), np.float32)
        self.observation_space = observation_space(nearest)
        self._field: Field | None = None
        self._steps: list[Step] = []
        self._outcome = Outcome.FLYING
        self._viewer: Any = None

    @property
    def field(self) -> Field:
        """The field being flown.

        Raises:
            RuntimeError: before the first reset.
        """
        if self._field is None:
            raise RuntimeError("no field yet: call reset() first")
        return self._field

    @property
    def state(self) -> State:
        """The vehicle's state, exactly; observations are rounded and clipped."""
        return self._steps[-1].state if self._steps else depart(self.field)

    @property
    def control(self) -> Array:
        """Segments flown so far (n, 4, 2)."""
        return np.array([step.control for step in self._steps if step.flown]).reshape(-1, 4, 2)

    @property
    def refused(self) -> Array | None:
        """The segment (4, 2) that ended the flight without being flown, if one did."""
        last = self._steps[-1] if self._steps else None
        return last.control if last is not None and not last.flown else None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a flight; see the class for which field it goes through.

        Raises:
            ValueError: unknown options, or a field that is none.
        """
        super().reset(seed=seed)
        self._field = self._choose(seed, options or {})
        self._steps = []
        self._outcome = Outcome.FLYING
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info()

    def _choose(self, seed: int | None, options: dict[str, Any]) -> Field:
        if unknown := set(options) - {"field"}:
            raise ValueError(f"unknown reset options {sorted(unknown)}; the only one is 'field'")
        given = options.get("field")
        if given is None:
            drawn = int(self.np_random.integers(2**31)) if seed is None else seed
            return suite_field(self.suite, self.split, drawn)
        field = one(given) if isinstance(given, str) else given
        if not isinstance(field, Field):
            raise ValueError(
                f"options['field'] must be a Field or the name of one, got {type(given).__name__}"
            )
        depart(field)  # refuses what is not planar
        return field

    def step(
        self, action: NDArray[np.floating[Any]]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Fly one segment.

        Raises:
            ValueError: an action of another shape, not finite or outside [-1, 1].
            RuntimeError: the flight is over, or there was no reset.
        """
        field = self.field
        if self._outcome is not Outcome.FLYING:
            raise RuntimeError(f"the flight is over ({self._outcome.sentence}): call reset()")
        before = self.state
        step = advance(field, before, np.asarray(action, dtype=np.float32), self.limits)
        self._steps.append(step)
        self._outcome = step.outcome
        if self.render_mode == "human":
            self.render()
        truncated = step.outcome is Outcome.OUT_OF_SEGMENTS
        terminated = step.outcome is not Outcome.FLYING and not truncated
        gain = reward(field, before, step)
        return self._observation(), gain, terminated, truncated, self._info()

    def _observation(self) -> Observation:
        return observe(self.field, self.state, self.limits, self.nearest)

    def _info(self) -> dict[str, Any]:
        flown = [step.inspection for step in self._steps if step.flown]
        obstacles = self.field.obstacles
        clear = [float(one.clearance) for one in flown]
        if len(obstacles):
            clear.append(float(obstacles.signed_distance(self.state.position).min()))
        return {
            "is_success": self._outcome.success,
            "outcome": self._outcome.code,
            "path_length": float(sum(float(one.length) for one in flown)),
            "clearance": min(clear, default=float("inf")),
            "segments": len(flown),
        }

    def render(self) -> NDArray[np.uint8] | None:
        """Draw the flight so far: an image (800, 800, 3), or a window in mode human.

        Raises:
            RuntimeError: before the first reset.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() without a render mode; pass render_mode='rgb_array' to gym.make()"
            )
            return None
        if self._viewer is None:
            # matplotlib is imported when something is drawn, not when an agent trains
            from ferguson_gym.viewer import Viewer

            self._viewer = Viewer(self.render_mode)
        image: NDArray[np.uint8] | None = self._viewer.draw(
            self.field, self.control, self.refused, self._outcome
        )
        return image

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None
