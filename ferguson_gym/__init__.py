"""The world: Ferguson splines, fields, certified clearance, and the environment on top.

Importing the package registers the environment `ferguson/ObstacleField-v0`.
"""

from gymnasium.envs.registration import register

__version__ = "0.1.0"

ENVIRONMENT_ID = "ferguson/ObstacleField-v0"

register(
    id=ENVIRONMENT_ID,
    entry_point="ferguson_gym.environment:ObstacleField",
    vector_entry_point="ferguson_gym.vector_environment:VectorObstacleField",
)
