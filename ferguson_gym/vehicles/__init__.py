"""Vehicles and their limits in time: what decides how fast a path can be flown.

A `Vehicle` has limits of speed, roll and acceleration; `get_vehicle` finds the shipped ones by name
and others in JSON files. `rates` certifies the speeds and accelerations of segments that are flown
in given durations, and a `VehicleOutcome` says which limit they break.
"""

from ferguson_gym.vehicles.timed_segments import Rates as Rates
from ferguson_gym.vehicles.timed_segments import rates as rates
from ferguson_gym.vehicles.vehicle import Vehicle as Vehicle
from ferguson_gym.vehicles.vehicle_names import get_vehicle as get_vehicle
from ferguson_gym.vehicles.vehicle_outcome import VehicleOutcome as VehicleOutcome
