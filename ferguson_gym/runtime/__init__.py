"""Foundations: array types and checks, compilation, threads, atomic file writes.

The modules with compiled code, `jit` and `helper_threads`, are imported by their own names, since
loading the compiler takes most of a second.
"""

from ferguson_gym.runtime.arrays import Array as Array
from ferguson_gym.runtime.arrays import finite as finite
from ferguson_gym.runtime.arrays import truncate_repr as truncate_repr
from ferguson_gym.runtime.atomic_files import atomic_write as atomic_write
from ferguson_gym.runtime.suggestions import did_you_mean as did_you_mean
