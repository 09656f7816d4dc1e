"""Windows of segments as optimisation problems, their solvers, and certification."""
