"""Benchmark of planners: all on the same fields with the same clock."""
