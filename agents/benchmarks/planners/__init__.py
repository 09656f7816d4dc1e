"""Planners on the same fields with the same clock.

`runs` plans and measures, `bench` makes the table and the files, `plots` the figures, and
`ompl_log` the log that OMPL's benchmark tools read.
"""
