"""Planners that decide one segment at a time from the state that was reached.

`RecedingHorizon` is the paper's planner, `Guided` optimises with the exact cost-to-go, and
`Convex` solves a bounded number of convex programs, and `Pursuit` follows the shortest path that
keeps a margin, without optimisation.
"""

from planners.receding_horizon.convex import Convex as Convex
from planners.receding_horizon.guided import Guided as Guided
from planners.receding_horizon.paper import RecedingHorizon as RecedingHorizon
from planners.receding_horizon.pursuit import Pursuit as Pursuit
