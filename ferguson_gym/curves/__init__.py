"""Ferguson segments in any number of dimensions, and what can be proved about them.

`evaluate` and `derivative` give points and derivatives, `length` the arc length with a relative
error of at most 1e-9, and `clearance` a certified distance from discs along whole segments; `Path`
is a checked chain, and `PathSamples` are points at even distances along it. Further modules have
curvature, turning, and the compiled kernels.
"""

from ferguson_gym.curves.arc_length import length as length
from ferguson_gym.curves.clearance import clearance as clearance
from ferguson_gym.curves.path import Path as Path
from ferguson_gym.curves.sampling import PathSamples as PathSamples
from ferguson_gym.curves.splines import derivative as derivative
from ferguson_gym.curves.splines import evaluate as evaluate
