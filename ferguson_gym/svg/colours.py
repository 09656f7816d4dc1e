"""The colours of fields and flights, in all pictures alike."""

OBSTACLE = "#c9ced6"
OBSTACLE_EDGE = "#8d96a3"
SEEN = "#a7b1be"
"""An obstacle that a plan looks at."""
SEGMENTS = ("#0b5fa5", "#e07b00")
"""Alternating colours of the segments of a path."""
HORIZON = "#8e44ad"
REFUSED = "#c0392b"
START = "#1e8449"
GOAL = "#c0392b"
