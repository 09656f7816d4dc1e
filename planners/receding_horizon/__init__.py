"""Planners that decide one segment at a time."""
