"""Drawings of fields and flights, and the environment's viewer."""
