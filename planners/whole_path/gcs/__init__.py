"""Routes by Graphs of Convex Sets, from Drake: one convex program over all ways through a field.

Reference:
    Marcucci, Petersen, von Wrangel & Tedrake (2023), Motion planning around obstacles with convex
    optimization, Science Robotics 8(84).
"""

from planners.whole_path.gcs.router import Gcs as Gcs
