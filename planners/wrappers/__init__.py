"""Planners around planners: backtracking, a limited sensing range, a safety margin."""
