"""The way ahead: points of the shortest path that keeps a margin, as policies can be shown them.

`Way` answers for any point of a field; `surroundings` grows obstacles by their margins.
"""

from ferguson_gym.guidance.margins import surroundings as surroundings
from ferguson_gym.guidance.way import Way as Way
