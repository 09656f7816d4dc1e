"""Vehicles and their limits in time: what decides how fast a path can be flown.

A `Vehicle` has limits of speed, roll and acceleration; `get_vehicle` finds the shipped ones by name
and others in JSON files.
"""

from ferguson_gym.vehicles.vehicle import Vehicle as Vehicle
from ferguson_gym.vehicles.vehicle_names import get_vehicle as get_vehicle
