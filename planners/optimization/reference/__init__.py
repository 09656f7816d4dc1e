"""Reference solvers of the same windows: SLSQP with an exchange method, IPOPT, two stages."""
