"""Benchmark of planners: the same fields, and the same timing.

`runs` plans and measures, `bench` makes the table and the files, `plots` the figures, and
`ompl_log` the log that OMPL's benchmark tools read.
"""
