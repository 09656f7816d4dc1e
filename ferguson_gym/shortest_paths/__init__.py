"""Exact shortest paths in the plane, the reference that flights are compared with.

`shortest_path` finds the path itself, `exact_length` its length, `gap` how much longer a flight
is; `DistanceToGoal` answers from any point of a field, and `best_classes` finds the shortest path
of each of the best homotopy classes.
"""

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal as DistanceToGoal
from ferguson_gym.shortest_paths.exact import exact_length as exact_length
from ferguson_gym.shortest_paths.exact import gap as gap
from ferguson_gym.shortest_paths.exact import reference_length as reference_length
from ferguson_gym.shortest_paths.exact import shortest_path as shortest_path
from ferguson_gym.shortest_paths.homotopy_classes import best_classes as best_classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath as ShortestPath
