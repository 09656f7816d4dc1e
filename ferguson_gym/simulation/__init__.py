"""The environment's step as compiled code: observations, reward, and many flights at once.

`Settings` are the environment's arguments; `BatchSimulator` steps N vehicles, each in a field of
its own, and both environments are built on it; `SimulatedRollouts` steps flights of one field
from any state, and `observe` writes observations without an environment.
"""

from ferguson_gym.simulation.batch_simulator import BatchSimulator as BatchSimulator
from ferguson_gym.simulation.observations import Observation as Observation
from ferguson_gym.simulation.observe import observe as observe
from ferguson_gym.simulation.observe import observe_one as observe_one
from ferguson_gym.simulation.saved_arguments import arguments_to_save as arguments_to_save
from ferguson_gym.simulation.saved_arguments import saved_arguments as saved_arguments
from ferguson_gym.simulation.settings import Settings as Settings
from ferguson_gym.simulation.settings import settings_of as settings_of
from ferguson_gym.simulation.simulated_rollouts import SimulatedRollouts as SimulatedRollouts
