"""Policies: whatever flies the environment, by name."""
