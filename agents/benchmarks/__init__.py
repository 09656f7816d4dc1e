"""Benchmarks of planners, solvers and environments, each in one run, behind `ferguson bench`.

`environment` measures steps per second, `planners` compares planners on the same fields, and
`solvers` compares solvers on the same windows.
"""
