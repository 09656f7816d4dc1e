"""Animations of flights."""
