"""Demonstrations: an expert's flights as datasets, recorded and read."""
