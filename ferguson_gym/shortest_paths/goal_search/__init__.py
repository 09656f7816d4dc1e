"""The search from the goal among many discs, which is kept and continued for each query."""
