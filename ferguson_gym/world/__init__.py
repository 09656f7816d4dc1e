"""Fields of obstacles, limits, feasibility, actions and what becomes of a flight."""
