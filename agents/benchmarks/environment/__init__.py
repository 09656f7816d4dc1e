"""Benchmark of the environment: steps per second beside Gymnasium's own."""
