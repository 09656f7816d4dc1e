"""Benchmarks of the environment, of planners and of solvers."""
