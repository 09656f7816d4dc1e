"""Planners of whole paths: a route, and segments fitted to it."""
