"""Figures and animations of flights, drawn with matplotlib.

`flight_grid` draws flights side by side, `policy_comparison` several policies on the same fields,
and `animation` a flight as it is decided. Importing this folder alone does not load matplotlib.
"""
