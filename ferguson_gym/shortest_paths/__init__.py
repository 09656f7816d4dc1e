"""Exact shortest paths among discs in the plane: lengths, distance to the goal, homotopy classes."""
