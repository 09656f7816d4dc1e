"""Wrappers of planners: `Backtracking`, limited `Sensing`, and a safety `Margin`."""

from planners.wrappers.backtracking import Backtracking as Backtracking
from planners.wrappers.limited_sensing import Sensing as Sensing
from planners.wrappers.safety_margin import Margin as Margin
