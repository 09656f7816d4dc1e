"""The environment's step as compiled code: observations, rewards, and many flights at once."""
