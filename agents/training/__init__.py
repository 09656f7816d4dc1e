"""Training of agents: imitation, and reinforcement learning by Stable-Baselines3.

A `Run` is the configuration of a training and its directory; `ALGORITHMS` lists the algorithms and
their hyperparameters by name, without PyTorch. `run` holds the run and its files, `hyperparameters`
reads YAML, `sb3` trains by PPO and TQC, `imitation` by behaviour cloning and DAgger.
`learning_curve` keeps the evaluations and the best model, `checkpoint` the state from which a
training resumes.
"""

from agents.training.run import ALGORITHMS as ALGORITHMS
from agents.training.run import Run as Run
