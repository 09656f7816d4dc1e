"""The world: Ferguson splines, fields, certified clearance, and the environment on top.

Importing the package registers the environment `ferguson/ObstacleField-v0`.
"""

from gymnasium.envs.registration import register

__version__ = "0.1.0"

register(
    id="ferguson/ObstacleField-v0",
    entry_point="ferguson_gym.environment:ObstacleField",
)
