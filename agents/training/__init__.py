"""Training of agents: runs, checkpoints, hyperparameters, and the algorithms of Stable-Baselines3."""
