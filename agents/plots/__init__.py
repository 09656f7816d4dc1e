"""Figures and animations of flights, drawn with matplotlib.

`flight_grid` draws flights side by side, `policy_comparison` draws several policies on the same
fields, and `animation` animates a flight, decision by decision. Importing this folder alone does
not load matplotlib.
"""

from ferguson_gym.runtime.cache_directory import find_matplotlib_cache

find_matplotlib_cache()
