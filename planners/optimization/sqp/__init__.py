"""The planners' solver: elastic sequential quadratic programming with exact Hessians.

`ElasticSqp` has the options of a search from one initial guess; `MultiStart` searches from many.
The constraints are the lengths (`expansion`), the contacts with discs, bounds and the lower bound
on |X'(t)| (`contacts`), with other obstacles (`core_contacts`), and the turn radius
(`turn_contacts`); `elastic_qp` assembles those of a step.
"""

from planners.optimization.sqp.elastic_sqp import ElasticSqp as ElasticSqp
from planners.optimization.sqp.multi_start import MultiStart as MultiStart
