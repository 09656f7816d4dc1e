"""Vehicles and their limits in time: what decides how fast a path can be flown.

A `Vehicle` has limits of speed, roll and acceleration; `get_vehicle` finds the shipped ones by name
and others in JSON files. `rates` certifies the speeds and accelerations of segments that are flown
in given durations, and a `VehicleOutcome` says which limit they break. `shortest_durations` gives a
chain of segments its durations, `fastest_along` finds the best speeds along a path,
`fastest_bound` is a time that no flight through a field beats, and `ranked_classes` has the ways
round that may be the fastest.
"""

from ferguson_gym.vehicles.bound import fastest_bound as fastest_bound
from ferguson_gym.vehicles.ranked_classes import RankedClass as RankedClass
from ferguson_gym.vehicles.ranked_classes import ranked_classes as ranked_classes
from ferguson_gym.vehicles.retiming import Retiming as Retiming
from ferguson_gym.vehicles.retiming import shortest_durations as shortest_durations
from ferguson_gym.vehicles.speed_profile import SpeedProfile as SpeedProfile
from ferguson_gym.vehicles.speed_profile import fastest_along as fastest_along
from ferguson_gym.vehicles.timed_segments import Rates as Rates
from ferguson_gym.vehicles.timed_segments import rates as rates
from ferguson_gym.vehicles.vehicle import Vehicle as Vehicle
from ferguson_gym.vehicles.vehicle_names import get_vehicle as get_vehicle
from ferguson_gym.vehicles.vehicle_outcome import VehicleOutcome as VehicleOutcome
