"""The planners' solver: elastic sequential quadratic programming with exact Hessians.

`ElasticSqp` has the options of a search from one start; `MultiStart` searches from many.
"""

from planners.optimization.sqp.elastic_sqp import ElasticSqp as ElasticSqp
from planners.optimization.sqp.multi_start import MultiStart as MultiStart
