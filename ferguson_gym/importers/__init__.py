"""Fields from files of other programs, a module for each format.

`read_geojson` reads building footprints, `read_map` the grids of the MovingAI benchmarks,
`read_world` worlds of cylinders and boxes for Gazebo, and `read_circles` tables of circles. Where a
source has no start, goal or bounds, a `Placement` says which a field gets.
"""

from ferguson_gym.importers.circles import read_circles as read_circles
from ferguson_gym.importers.gazebo import read_world as read_world
from ferguson_gym.importers.geojson import read_geojson as read_geojson
from ferguson_gym.importers.movingai import read_map as read_map
from ferguson_gym.importers.placement import Placement as Placement
