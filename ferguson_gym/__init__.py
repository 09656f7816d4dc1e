"""A Gymnasium environment for flight along Ferguson splines, with certified collision checks.

Importing the package registers the environment `ferguson/ObstacleField-v0` and nothing else. The
public names below are imported when they are first used, so that `import ferguson_gym` costs little
more than `import gymnasium` and loads neither the compiler nor matplotlib. Folders, lowest layer
first: `runtime` (arrays, compiled functions, threads), `svg` (pictures), `curves` (Ferguson
segments and their certified clearance), `world` (fields, limits, actions, feasibility),
`shortest_paths` (exact), `vehicles` (how fast they fly), `simulation` (the compiled step) and
`rendering`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from ferguson_gym.environment import ObstacleField as ObstacleField
    from ferguson_gym.vector_environment import VectorObstacleField as VectorObstacleField
    from ferguson_gym.vehicles import Vehicle as Vehicle
    from ferguson_gym.vehicles import get_vehicle as get_vehicle
    from ferguson_gym.world import Field as Field
    from ferguson_gym.world import Limits as Limits
    from ferguson_gym.world import Obstacles as Obstacles
    from ferguson_gym.world import Outcome as Outcome
    from ferguson_gym.world import get_field as get_field
    from ferguson_gym.world import get_fields as get_fields

__version__ = "0.1.0"

ENVIRONMENT_ID = "ferguson/ObstacleField-v0"

register(
    id=ENVIRONMENT_ID,
    entry_point="ferguson_gym.environment:ObstacleField",
    vector_entry_point="ferguson_gym.vector_environment:VectorObstacleField",
)

if not TYPE_CHECKING:  # a type checker that saw it would accept any name
    _MODULES = {
        "ObstacleField": "ferguson_gym.environment",
        "VectorObstacleField": "ferguson_gym.vector_environment",
        **dict.fromkeys(
            ("Field", "Limits", "Obstacles", "Outcome", "get_field", "get_fields"),
            "ferguson_gym.world",
        ),
        **dict.fromkeys(("Vehicle", "get_vehicle"), "ferguson_gym.vehicles"),
    }

    def __getattr__(name):
        """Import a public name when it is first used."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return value

    def __dir__():
        return sorted({*globals(), *_MODULES})
