"""Vehicles: their limits, names and files."""

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ferguson_gym.curves.turning import fastest_turn
from ferguson_gym.vehicles.vehicle import Vehicle, from_json, to_json
from ferguson_gym.vehicles.vehicle_names import VEHICLES, get_vehicle


def test_shipped_vehicles_have_the_limits_of_the_documentation() -> None:
    wing, rotor = get_vehicle("fixed-wing"), get_vehicle("multirotor")
    assert (wing.min_speed, wing.max_speed, wing.max_roll) == (6.0, 15.0, 45.0)
    assert (wing.max_path_acceleration, wing.max_acceleration) == (4.0, None)
    assert (rotor.min_speed, rotor.max_speed, rotor.max_roll) == (0.0, 15.0, None)
    assert (rotor.max_path_acceleration, rotor.max_acceleration) == (None, 8.0)
    assert (wing.start_speed, rotor.start_speed) == (6.0, 5.0)


def test_the_paper_s_vehicle_flies_the_paper_s_turn() -> None:
    paper = get_vehicle("paper")
    assert paper.turn_radius(fastest_turn(3.0)) == pytest.approx(3.0)
    # lift grows by the load factor, so that the least speed in the turn does by its root
    load = 1.0 / math.cos(math.radians(60.0))
    assert paper.min_speed * math.sqrt(load) < fastest_turn(3.0) < paper.max_speed


def test_the_tightest_turn_obeys_roll_and_total_acceleration() -> None:
    assert Vehicle(max_speed=9.0).turn_radius(9.0) == 0.0
    assert Vehicle(max_speed=9.0, max_acceleration=3.0).turn_radius(9.0) == 27.0
    both = Vehicle(max_speed=9.0, max_roll=45.0, max_acceleration=3.0)
    assert both.turn_radius(9.0) == 27.0
    assert both.max_longitudinal == 3.0
    assert Vehicle(max_speed=9.0).max_longitudinal == math.inf


@pytest.mark.parametrize("name", VEHICLES)
def test_a_vehicle_is_read_back_as_it_was_written(name: str, tmp_path: Path) -> None:
    vehicle = get_vehicle(name)
    to_json(vehicle, tmp_path / "mine.json")
    assert from_json(tmp_path / "mine.json") == dataclasses.replace(vehicle, name="mine")
    assert get_vehicle(str(tmp_path / "mine.json")).name == "mine"


BAD: list[tuple[dict[str, Any], str]] = [
    ({"max_speed": 0}, "max_speed of a vehicle must be above 0, got 0"),
    ({"max_speed": math.inf}, "max_speed of a vehicle must be finite"),
    ({"max_speed": True}, "max_speed of a vehicle must be a number, got True"),
    ({"max_speed": 5, "max_roll": np.True_}, "max_roll of a vehicle must be a number"),
    ({"max_speed": "fast"}, "max_speed of a vehicle must be a number, got 'fast'"),
    ({"max_speed": 5, "min_speed": 6}, "need 0 <= min_speed < max_speed, got 6 m/s and 5 m/s"),
    ({"max_speed": 5, "min_speed": -1}, "need 0 <= min_speed < max_speed, got -1 m/s"),
    ({"max_speed": 5, "min_speed": math.nan}, "min_speed of a vehicle must be finite"),
    ({"max_speed": 5, "max_roll": 90}, "angle below 90 degrees, got 90; omit it for no limit"),
    ({"max_speed": 5, "max_roll": 0}, "max_roll of a vehicle must be above 0, got 0; omit it"),
    ({"max_speed": 5, "max_acceleration": -2}, "max_acceleration of a vehicle must be above 0"),
    (
        {"max_speed": 5, "max_acceleration": 2, "max_path_acceleration": 3},
        "max_path_acceleration of 3 m/s.2 exceeds max_acceleration of 2 m/s.2.*omit one",
    ),
]


@pytest.mark.parametrize(("limits", "message"), BAD)
def test_limits_that_no_vehicle_has_are_refused(limits: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Vehicle(**limits)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[15]", "a vehicle is a JSON object with max_speed"),
        ('{"min_speed": 5}', "a vehicle is a JSON object with max_speed"),
        ('{"maxspeed": 5}', "'maxspeed' of a vehicle .did you mean 'max_speed'"),
        ('{"max_speed": true}', "max_speed of a vehicle must be a number, got True"),
        ('{"max_speed": 5, "' + 300 * "x" + '": 5}', "unknown limit 'x{56}[.]{3} of a vehicle"),
        ('{"max_speed": 5, "max_rol": 5}', "'max_rol' of a vehicle .did you mean 'max_roll'"),
        ('{"max_speed": 5, "min_speed": 9}', "min_speed < max_speed"),
        ("{", "not JSON"),
    ],
)
def test_bad_files_are_named(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        get_vehicle(str(file))
    assert str(file) in str(caught.value)


def test_null_means_no_limit(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    file.write_text(json.dumps({"max_speed": 5, "max_roll": None}))
    assert get_vehicle(str(file)) == Vehicle(name="mine", max_speed=5.0)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fixd-wing", "unknown vehicle 'fixd-wing' .did you mean 'fixed-wing'.*multirotor"),
        ("", "unknown vehicle ''"),
        ("a\0b", "unknown vehicle"),
        ("x" * 5000, "unknown vehicle"),
        ("nowhere.json", "no such vehicle file: 'nowhere.json'"),
    ],
)
def test_unknown_names_are_refused(name: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        get_vehicle(name)


def test_wind_and_start_speed_are_checked() -> None:
    wing = get_vehicle("fixed-wing")
    assert wing.check_wind(None).tolist() == [0.0, 0.0]
    assert wing.check_wind([3, 4]).tolist() == [3.0, 4.0]
    with pytest.raises(ValueError, match=r"wind of 15 m/s is too fast for fixed-wing.*15 m/s"):
        wing.check_wind([9, 12])
    with pytest.raises(ValueError, match="wind must have shape"):
        wing.check_wind([1, 2, 3])
    assert wing.check_start_speed(None) == 6.0
    assert wing.check_start_speed(15) == 15.0
    for speed in (5.9, 15.1):
        with pytest.raises(ValueError, match="outside the speeds of fixed-wing, 6 to 15 m/s"):
            wing.check_start_speed(speed)
    with pytest.raises(ValueError, match="must be finite"):
        wing.check_start_speed(np.nan)
