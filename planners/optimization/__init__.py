"""Optimisation of windows of segments, and the certification of what solvers return.

A `Window` is a nonlinear programme over a few segments: a chain, an objective and constraints.
`MultiStart` solves it from many first guesses by elastic SQP (`sqp`); `reference` has the paper's
solver and others to compare with. `certify` proves chains feasible.
"""

from planners.optimization.certification import certify as certify
from planners.optimization.initial_guesses import FirstGuess as FirstGuess
from planners.optimization.initial_guesses import Proposer as Proposer
from planners.optimization.initial_guesses import RandomGuess as RandomGuess
from planners.optimization.initial_guesses import along_route as along_route
from planners.optimization.sqp.multi_start import MultiStart as MultiStart
from planners.optimization.sqp.multi_start import offset_guesses as offset_guesses
from planners.optimization.window import Window as Window
