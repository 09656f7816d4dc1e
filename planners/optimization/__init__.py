"""Optimisation of windows of segments, and the certification of what solvers return.

A `Window` is a nonlinear program over a few segments: a chain, an objective and constraints.
`MultiStart` solves it from many initial guesses by elastic SQP; its constraints are the contacts in
`sqp`. `reference` has solvers to compare with (SLSQP in place of the paper's, IPOPT); they use
`sampled_constraints`. `certify` proves chains feasible.
"""

from planners.optimization.certification import certify as certify
from planners.optimization.initial_guesses import FirstGuess as FirstGuess
from planners.optimization.initial_guesses import Proposer as Proposer
from planners.optimization.initial_guesses import RandomGuess as RandomGuess
from planners.optimization.initial_guesses import along_route as along_route
from planners.optimization.sqp.multi_start import MultiStart as MultiStart
from planners.optimization.sqp.multi_start import offset_guesses as offset_guesses
from planners.optimization.window import Window as Window
