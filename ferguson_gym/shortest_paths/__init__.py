"""Exact shortest paths among discs in the plane, distance to the goal, homotopy classes."""
