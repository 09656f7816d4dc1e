"""Training of agents: runs, checkpoints, hyperparameters, and Stable-Baselines3's algorithms."""
