"""Chains by convex programs: half-planes that turn along segments keep them beyond obstacles.

`nominal_chain` puts even segments on the shortest path, and a `ChainSolver` makes them short and
certified by a number of quadratic programs that has a bound.
"""

from planners.optimization.convex.chain_solver import ChainSolver as ChainSolver
from planners.optimization.convex.chain_solver import Effort as Effort
from planners.optimization.convex.chain_solver import Found as Found
from planners.optimization.convex.chain_solver import detour as detour
from planners.optimization.convex.nominal import extended_plan as extended_plan
from planners.optimization.convex.nominal import nominal_along as nominal_along
from planners.optimization.convex.nominal import nominal_chain as nominal_chain
from planners.optimization.convex.solver import Caps as Caps
