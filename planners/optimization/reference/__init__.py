"""Reference solvers of windows: SLSQP or IPOPT with exchange, and the paper's two stages."""

from planners.optimization.reference.exchange import ByExchange as ByExchange
from planners.optimization.reference.ipopt import Ipopt as Ipopt
from planners.optimization.reference.slsqp import Slsqp as Slsqp
from planners.optimization.reference.two_stage import TwoSteps as TwoSteps
