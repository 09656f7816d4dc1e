"""Learned models on disk, and their networks."""
