"""The Gymnasium environment `ferguson/ObstacleField-v0`."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from ferguson_gym.arguments import ScalarArguments
from ferguson_gym.runtime.arrays import Array, truncate_repr
from ferguson_gym.simulation.batch_simulator import NOT_STARTED, BatchSimulator
from ferguson_gym.simulation.observations import FlatObservation, Observation, entries_of
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.simulation.step_buffers import DISABLED
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

RENDER_MODES = ("human", "rgb_array", "rgb_array_list")


class ObstacleField(ScalarArguments, gym.Env[Any, Action]):
    """Fly from (0, 0) to (100, 100) around obstacles, one smooth segment at a time.

    ## Description
    A vehicle flies in the plane along Ferguson (cubic Hermite) segments that join with equal
    derivatives. Each action is a segment; an episode is a flight. Every segment is certified along
    its whole length, not sampled. Obstacles are random discs, or, in fields of your own, any convex
    cores grown by radii (`ferguson_gym.world.obstacles.Obstacles`). After the paper Receding
    Horizon UAV Path Planning Via Gradient-Based Optimization of Ferguson Splines (2015).

    ## Action space
    `Box(-1, 1, (4,), float32)`, in the body frame. Zero flies 9 m straight ahead. Every feasible
    segment has exactly one action (`ferguson_gym.world.actions.encode`).

    | entry | meaning | -1 | 0 | +1 |
    | --- | --- | --- | --- | --- |
    | 0 | end point, forward (with entry 1 at 0) | 15 m back | 9 m ahead | 15 m ahead |
    | 1 | end point, to the left (with entry 0 at 0) | -7.1 m | 0 m | 7.1 m |
    | 2 | end derivative, along its first axis | -66 m | 9 m | 66 m |
    | 3 | end derivative, along its second axis | -66 m | 0 m | 66 m |

    Entries 0 and 1 together set the end point, by a Möbius map of the unit disc: it is
    `15.001 m (q + z) / (1 + q z)` with `z = a[0] + i a[1]` and `q = 9 / 15.001`, the real axis
    forward. The frame of the end derivative is rotated by 2 y / 9 rad, with y the lateral offset
    [m] of the end point to the left. With entries 2 and 3 at zero, a segment therefore approximates
    a circular arc. An end point within the gate of the goal is moved onto the goal.

    ## Observation space
    `Dict` of vectors, float32, all in [-1, 1]. Lengths are divided by `view` unless said otherwise,
    and clipped. With `flat=True` they are one vector, a `Box`, in the order of
    `gymnasium.spaces.flatten`: goal, mask, obstacles, rays, vehicle, way.

    | key | size | holds | range |
    | --- | --- | --- | --- |
    | vehicle | 6 | position, x and y, the bounds scaled to -1..1 | -1..1 |
    | | | heading, cosine and sine | -1..1 |
    | | | speed v, scaled as in the action: asinh(v sinh(4) / 66 m) / 4 | 0..1 |
    | | | fraction of segments left | 0..1 |
    | goal | 3 | distance / diagonal of the bounds | 0..1 |
    | | | direction, forward and to the left, a unit vector | -1..1 |

    Obstacles are observed as a lidar would measure them with `observation="rays"` (the default), as
    the nearest discs with `observation="discs"`, or both with `observation="both"`:

    | key | size | holds | range |
    | --- | --- | --- | --- |
    | rays | `rays` | range to an obstacle or bound, counter-clockwise from straight ahead | 0..1 |
    | obstacles | 4 `nearest` | rows of four, nearest first: centre, forward and left | -1..1 |
    | | | radius | 0..1 |
    | | | distance from the vehicle to the obstacle's surface | -1..1 |
    | mask | `nearest` | 1 for an obstacle, 0 for a row of padding | 0..1 |

    The obstacles are those whose surface is within `view` of the point `focus` metres ahead of the
    vehicle, the nearest to that point first. From rays a plain network learns to fly; from discs it
    learns almost nothing in the same number of steps (docs/learnability.md).

    An obstacle of another shape is a core (the convex hull of its corners) grown by a radius. Its
    row shows, in place of a centre, the point of the core's outline that is nearest to the vehicle;
    its radius is that of the core, 0 for a polygon with sharp corners; and the distance is that
    from the vehicle to the obstacle's surface, negative inside. The row is thus that of a disc,
    which lies in the obstacle, is as far away and in the same direction; it glides along the core
    as the vehicle moves. For a disc, whose core is its centre, this is the same as above.

    Rays end at the surface of every shape, also at edges and rounded corners, to single precision
    (some micrometres). From inside an obstacle, where the tolerance allows a vehicle to be, those
    that lead into it are zero.

    With `way=N` the vehicle is shown the way, which is **global knowledge**: it comes from the
    whole field, seen or not. The way is the shortest path to the goal that keeps `margin` from
    obstacles, less where that would close a passage:

    | key | size | holds | range |
    | --- | --- | --- | --- |
    | way | 2 N + 2 | N points ahead, at 1/N to N/N of `view` along the way, | |
    | | | each forward and to the left | -1..1 |
    | | | distance to go along the way / `view` | 0..1 |
    | | | the same / twice the diagonal of the bounds | 0..1 |

    Without a path to the goal, the points are at the vehicle and both distances are 1.

    ## Scale
    Lengths in the two sections above hold for fields whose longest segment is 15 m, the default. A
    field with other limits (`Field.limits`, the key `limits` of a JSON file) has its own scale: the
    reach of actions, `view`, `focus` and `margin` are multiplied by its longest segment / 15 m, so
    that a field and its scaled copy give the same observations and rewards for the same actions.

    ## Reward
    `(progress - detour (length - progress)) / D`, with progress the decrease of the straight
    distance to the goal, length the segment's arc length and D the straight distance from start to
    goal (141.42 m); minus `failure` if the flight ends without reaching the goal, also by
    truncation. The progress of all segments sums to at most D, and no segment is shorter than its
    progress, so loops are never rewarded. A successful flight of L metres returns 1 - detour (L / D
    - 1). With the default penalties, `detour` 4 and `failure` 2, and the usual start and goal, a
    step's reward lies between -2.96 (a 15 m segment straight away from the goal that exhausts the
    limit of segments) and 0.107 (15 m straight to the goal).

    With `progress="way"`, progress and D are measured along the way that keeps `margin`, which is
    global knowledge, too; in a field without a path to the goal they remain straight. From within a
    margin, progress can exceed a segment's length, but its sum cannot exceed D.

    ## Training
    With the defaults of most libraries nothing is learned. Begin with a discount of 0.9, since a
    collision is caused by the last action or two, and with noise of standard deviation 0.2 in each
    entry of an action, since most of the action box asks for segments that are refused. Plain PPO
    on rays then reaches the goal in 60 % of the validation fields after half a million steps, and
    in 77, 83 and 92 % after 5, 20 and 60 minutes on one core; docs/learnability.md has settings and
    commands.

    ## Starting state
    (0, 0), with a derivative of 5 m per unit t towards the goal. `reset(seed=s)` starts in the
    field `SUITE/SPLIT:s`; a later `reset()` without a seed draws s below `fields` with `np_random`;
    `reset(options={"field": field})` starts in a given field, a `Field` or its name.

    ## Fields of your own
    `fields` may also name the fields from which resets draw, each with the same probability: a
    `Field`, a name such as `"forest/train:0-99"`, a JSON file, a directory of such files, or a list
    of these. Of n such fields `reset(seed=s)` flies the one of the number s modulo n, in the order
    given, so that the seeds 0 to n - 1 fly each of them once. Files are read when the environment
    is made. `suite` and `split` then have no effect.

    ## Termination
    The flight ends on the goal, or with an infeasible segment: one that collides with an obstacle,
    is longer than 15 m or shorter than 3 m, has a derivative below 0.1 m per unit t somewhere, or
    leaves the bounds (-10, 110). An infeasible segment is not flown, so the state does not change.

    ## Truncation
    After `segments` segments, which `env.spec.max_episode_steps` repeats.

    ## Info
    | key | type | holds |
    | --- | --- | --- |
    | is_success | bool | the flight ended on the goal |
    | outcome | int | code of `ferguson_gym.world.outcome.Outcome`; 0 while flying |
    | path_length | float | flown so far [m] |
    | clearance | float | minimum clearance so far [m] |
    | segments | int | flown so far |
    | shortest | float | with `reference=True`, length of the shortest path from the start [m] |

    ## Rendering
    | mode | `render()` returns | `render_fps` |
    | --- | --- | --- |
    | rgb_array | an image (800, 800, 3) of the flight so far | 4 |
    | rgb_array_list | a list of images along the flight since the last call | 20 |
    | human | None; the flight is shown in a window, or in a notebook | 4 |

    The list holds the start, an image every 1.5 m along each segment, and the end for a second (20
    times); a reset clears it. `ferguson_gym.rendering.RecordVideo` writes it to a smooth video. In
    a notebook, mode human shows a flight as one picture that is updated in place.

    ## Changes between flights
    `suite`, `split`, `fields`, `obstacles`, `radii`, `gate`, `segments`, `detour` and `failure` may
    change, for example in a curriculum. A change takes effect at the next reset and lasts, also
    when a vector environment resets a flight on its own:

    - `env.unwrapped.obstacles = 20`, or `env.set_wrapper_attr("obstacles", 20)` through wrappers;
    - `env.unwrapped.set_arguments(obstacles=20, radii=(1, 3))` for several at once;
    - `env.reset(options={"obstacles": 20})`, with the reset itself.

    Vector environments have `set_attr` and `set_arguments`, those of Stable-Baselines3 `set_attr`
    and `env_method("set_arguments", obstacles=20)`. Other arguments shape observations, rewards
    or infos and are fixed.

    ## Copies
    `copy.deepcopy` and `pickle` make copies that go on exactly as the original, with the same
    fields to come. A copy takes some kilobytes, whatever `fields` is: it makes fields again from
    seeds.

    ## Arguments
    All are kept in `env.spec`, so that `gym.make(env.spec)` makes the same environment. `capacity`
    matters only for vector environments; the scalar environment reallocates as needed. It counts
    obstacles, whatever number of corners they have.

    | argument | default | meaning |
    | --- | --- | --- |
    | `suite` | standard | or sparse, dense, forest, traps, town, walls |
    | `split` | train | or validation, test |
    | `fields` | 10000 | later resets draw seeds from 0 to `fields` - 1; or the fields to draw |
    | `obstacles` | None | number of obstacles, instead of the suite's |
    | `radii` | None | their (minimum, maximum) radius [m], instead of the suite's |
    | `gate` | None | distance [m] from the goal within which an end point is moved onto it |
    | `segments` | None | maximum number of segments of a flight |
    | `observation` | rays | or discs, or both |
    | `nearest` | 12 | number of obstacles observed |
    | `focus` | 0.0 | distance ahead of the vehicle [m] of the point to which they are nearest |
    | `rays` | 64 | number of rays, at equal angles |
    | `view` | 30.0 | range of observation [m], by which lengths are divided |
    | `way` | 0 | number of points of the way ahead that are shown |
    | `margin` | 0.8 | distance [m] that the way keeps from obstacles |
    | `flat` | False | whether observations are one vector |
    | `progress` | straight | or way: how rewards measure progress |
    | `reference` | False | whether infos tell the length of the shortest path |
    | `detour`, `failure` | 4.0, 2.0 | penalties in the reward |
    | `capacity` | None | maximum number of obstacles of a field, if above the suite's or pool's |
    | `render_mode` | None | or human, rgb_array, rgb_array_list |

    Without `gate` and `segments`, each field's limits hold: 1 m and 40 in those of the suites.

    ```python
    import gymnasium as gym
    import ferguson_gym

    env = gym.make("ferguson/ObstacleField-v0", suite="standard", split="train")
    envs = gym.make_vec("ferguson/ObstacleField-v0", num_envs=256)
    ```

    ## Version history
    - v0: first version.

    Raises:
        ValueError: an argument of the wrong type or out of range.
        TypeError: an unknown argument.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 (Gymnasium declares it so)
        "render_modes": list(RENDER_MODES),
        "render_fps": 4,
    }

    def __init__(self, render_mode: str | None = None, **arguments: Any) -> None:
        settings = settings_of(arguments, type(self).__name__, "render_mode")
        if render_mode not in (None, *RENDER_MODES):
            raise ValueError(
                f"unknown render mode {truncate_repr(render_mode)}; "
                f"modes are {', '.join(RENDER_MODES)}"
            )
        self.render_mode = render_mode
        if render_mode == "rgb_array_list":
            from ferguson_gym.rendering.motion import FPS

            self.metadata = {**self.metadata, "render_fps": FPS}
        self.action_space = action_space()
        self.observation_space = observation_space(settings)
        self._simulator = BatchSimulator(settings, 1, DISABLED)
        self._sizes, self._flat = settings.layout.entries(), settings.flat
        self._infos = settings.infos
        self._field: Field | None = None
        self._spec: EnvSpec | None = None
        self._viewer: Any = None

    @property
    def field(self) -> Field:
        """The field being flown.

        Raises:
            RuntimeError: before the first reset.
        """
        self._started()
        if self._field is None:
            self._field = self._simulator.field(0)
        return self._field

    def _started(self) -> None:
        if self._simulator.outcome[0] == NOT_STARTED:
            raise RuntimeError("no field yet: call reset() first")

    @property
    def state(self) -> State:
        """The vehicle's state in double precision; observations are rounded and clipped."""
        self._started()
        return self._simulator.state(0)

    @property
    def control(self) -> Array:
        """Segments flown so far (n, 4, 2)."""
        return self._simulator.control(0)

    @property
    def refused(self) -> Array | None:
        """The segment (4, 2) that was refused and so ended the flight, if one was."""
        return self._simulator.refused(0)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start a flight; see the class for which field it goes through.

        Raises:
            ValueError: unknown options; a bad value of an argument; a field of another type, an
                unknown name or a field that is not planar; or a seed that is not an integer
                from 0 to 2**63 - 1.
        """
        known, arguments = known_options(options, "field")
        changes = {0: self.settings.changed(arguments)} if arguments else None
        given, seed = known.get("field"), as_seed(seed)
        field = seed if given is None else as_field(given)
        if isinstance(field, Field):
            self._simulator.ensure_capacity(field)
        super().reset(seed=seed)
        renewed = np.array([seed is not None])
        self._simulator.reset(_ONE, [field], [self.np_random], renewed, changes)
        if arguments:
            self.spec = self._spec
        self._field = None
        if self._viewer is not None:
            self._viewer.begin()
        if self.render_mode == "human":
            self.render()
        return self._observation(), self._info()

    def step(
        self, action: NDArray[np.floating[Any]]
    ) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Fly one segment.

        Raises:
            ValueError: an action of another shape, not finite or outside [-1, 1].
            RuntimeError: the flight is over, or there was no reset.
        """
        self._started()
        if (code := int(self._simulator.outcome[0])) != Outcome.FLYING.code:
            sentence = Outcome.from_code(code).sentence
            raise RuntimeError(f"the flight is over ({sentence}): call reset()")
        actions = as_actions(action, (4,))[None]
        self._simulator.step(actions, [self.np_random])
        if self.render_mode == "human":
            self.render()
        report = self._simulator.reports[0]
        return (
            self._observation(),
            float(report["reward"]),
            bool(report["terminated"]),
            bool(report["truncated"]),
            self._info(),
        )

    def _observation(self) -> Observation | FlatObservation:
        flat = self._simulator.observations.copy()
        return flat if self._flat else entries_of(flat, self._sizes)

    def _info(self) -> dict[str, Any]:
        report = self._simulator.reports[0]
        return {key: report[key].item() for key in self._infos}

    def render(self) -> Any:
        """Draw the flight so far: an image, a list of images, or None; see the class.

        Raises:
            RuntimeError: before the first reset.
        """
        if self.render_mode is None:
            gym.logger.warn(
                "render() without a render mode; pass render_mode='rgb_array' to gym.make()"
            )
            return None
        field = self.field
        if self._viewer is None:
            # matplotlib is imported when something is drawn, not when an agent trains
            from ferguson_gym.rendering.viewer import Viewer

            self._viewer = Viewer(self.render_mode)
        outcome = Outcome.from_code(int(self._simulator.outcome[0]))
        return self._viewer.draw(field, self.control, self.refused, outcome)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None


_ONE = np.ones(1, np.bool_)
