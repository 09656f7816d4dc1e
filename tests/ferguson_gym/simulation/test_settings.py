"""What the environments are made with: fields, difficulty, and what they cost in memory."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ferguson_gym.environment import ObstacleField
from ferguson_gym.simulation import drawn_fields
from ferguson_gym.simulation.batch_simulator import BLOCK, FIRST_BLOCK
from ferguson_gym.simulation.settings import MAX_OBSTACLES, Settings
from ferguson_gym.vector_environment import VectorObstacleField
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_pool import MAX_FIELDS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.suites import SUITES, Scattered, suite_field
from tests.support.places import ROOT

OPEN = Field(name="open", obstacles=Obstacles.discs([], []))
SCATTERED = [suite for suite, recipe in SUITES.items() if isinstance(recipe, Scattered)]


def assert_same_discs(one: Field, other: Field) -> None:
    np.testing.assert_array_equal(one.obstacles.points, other.obstacles.points)
    np.testing.assert_array_equal(one.obstacles.radii, other.obstacles.radii)


@pytest.mark.parametrize("suite", SUITES)
def test_fields_are_the_suites_own_when_nothing_is_altered(suite: str) -> None:
    env = ObstacleField(suite=suite, split="validation")
    env.reset(seed=3)
    for _ in range(3):
        name = env.field.name
        seed = int(name.removeprefix(f"{suite}/validation:"))
        assert_same_discs(env.field, suite_field(suite, "validation", seed))
        # the distance to what is flown through is that of the field
        _, info = env.reset(options={"field": name})
        assert info["clearance"] == env.field.obstacles.signed_distance(np.zeros(2)).min()
        env.reset()


@pytest.mark.parametrize("suite", SCATTERED)
@pytest.mark.parametrize(
    ("obstacles", "radii"),
    [(0, None), (1, None), (33, None), (200, None), (None, (0.5, 2.0)), (7, [5, 5]), (50, (1, 7))],
)
def test_numbers_and_radii_of_obstacles_are_what_was_asked_for(
    suite: str, obstacles: int | None, radii: Any
) -> None:
    envs = VectorObstacleField(3, suite=suite, obstacles=obstacles, radii=radii, fields=20)
    usual = SUITES[suite]
    low, high = (usual.smallest, usual.largest) if radii is None else radii
    words = f"{suite}/train:[0-9]+"
    if obstacles is not None:
        words += f", {obstacles} obstacles"
    if radii is not None:
        words += f", radii {low:g} to {high:g} m"
    for seed in (5, None, None):
        envs.reset(seed=seed)
        for i in range(3):
            field = envs.field(i)
            assert re.fullmatch(words, field.name)
            expected = sum(usual.designs) if obstacles is None else obstacles
            assert len(field.obstacles) == expected
            if expected:
                assert low <= field.obstacles.radii.min()
                assert field.obstacles.radii.max() <= high
            # the name is enough to find the field again
            again = envs.settings.field(int(re.search(r":(\d+)", field.name)[1]))
            assert again.name == field.name
            assert_same_discs(again, field)
    # and they are what is flown through
    _, infos = envs.reset()
    for i in range(3):
        gaps = envs.field(i).obstacles.signed_distance(np.zeros(2))
        assert infos["clearance"][i] == gaps.min(initial=np.inf)


def test_as_many_obstacles_of_the_same_radii_are_the_suites_own_fields() -> None:
    for suite, number in (("standard", 50), ("sparse", 20), ("dense", 70)):
        same = Settings(suite=suite, obstacles=number, radii=(3, 7)).field(4)
        assert_same_discs(same, suite_field(suite, "train", 4))


def test_more_obstacles_crowd_the_field() -> None:
    clear = []
    for obstacles in (0, 10, 40, 160):
        envs = VectorObstacleField(20, obstacles=obstacles, fields=1)
        _, infos = envs.reset(seed=0)
        clear.append(infos["clearance"].mean())
    assert clear == sorted(clear, reverse=True)
    assert clear[0] == np.inf
    assert clear[1] > clear[3] + 1.0


@pytest.mark.parametrize("gate", [0.0, 0.5, 2.9])
def test_the_gate_decides_what_counts_as_the_goal(gate: float) -> None:
    for off, reached in ((0.99 * gate, True), (1.01 * gate + 1e-3, False)):
        env = ObstacleField(gate=gate)
        field = Field(name="near", obstacles=Obstacles.discs([], []), goal=[6.0, 6.0])
        env.reset(options={"field": field})
        end = field.goal - off * np.ones(2) / np.sqrt(2.0)
        segment = np.array([env.state.position, end, env.state.derivative, [5.0, 5.0]])
        # to a rounding of float32 the encoded end is the one asked for
        reached = reached and gate > 0.0
        *_, terminated, _, info = env.step(encode(segment, segment[0], segment[2]))
        assert terminated == info["is_success"] == reached
        np.testing.assert_allclose(env.state.position, field.goal if reached else end, atol=1e-5)


@pytest.mark.parametrize("segments", [1, 3, 41])
def test_flights_end_after_their_segments(segments: int) -> None:
    env = ObstacleField(segments=segments, obstacles=0)
    env.reset(options={"field": OPEN})
    for k in range(1, segments + 1):
        step = 3.1 / np.sqrt(2.0) * k
        segment = [env.state.position, [step, step], env.state.derivative, [2.0, 2.0]]
        action = encode(segment, env.state.position, env.state.derivative)
        seen, _, terminated, truncated, info = env.step(action)
        assert seen["vehicle"][5] == np.float32(1.0 - k / segments)
        assert not terminated
        assert truncated == (k == segments)
    assert info["outcome"] == Outcome.OUT_OF_SEGMENTS.code
    assert env.control.shape == (segments, 4, 2)


def test_later_resets_draw_from_as_many_fields_as_asked_for() -> None:
    for number in (1, 3):
        envs = VectorObstacleField(2, fields=number)
        names = set()
        for _ in range(40):
            envs.reset()
            names |= {envs.field(i).name for i in range(2)}
        assert names == {f"standard/train:{seed}" for seed in range(number)}


def test_only_fields_that_are_drawn_are_made_and_each_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, usual = [], drawn_fields._put

    def put(*given: Any) -> None:
        made.extend(given[-1].tolist())
        usual(*given)

    monkeypatch.setattr(drawn_fields, "_put", put)
    envs = VectorObstacleField(2, fields=MAX_FIELDS)
    assert not made
    envs.reset(seed=0)
    # the two that were asked for; a block of others when the first of them is flown
    assert made == [0, 1]
    for _ in range(FIRST_BLOCK):
        envs.reset()
        assert len(made) == 2 + 2 * FIRST_BLOCK
    envs.reset()
    assert 2 + 2 * FIRST_BLOCK < len(made) <= 2 + 2 * (FIRST_BLOCK + BLOCK)
    assert max(made) > MAX_FIELDS / 2
    made.clear()
    envs = VectorObstacleField(5, fields=7)
    for _ in range(2 * FIRST_BLOCK):
        envs.reset()
    assert sorted(made) == list(range(7))


def resident(script: str) -> float:
    """Most memory [MB] that a script's process held; what importing takes is part of it."""
    script = f"""
import numpy as np
from ferguson_gym.vector_environment import VectorObstacleField
{script}
for line in open("/proc/self/status"):
    if line.startswith("VmHWM"):
        print(int(line.split()[1]) / 1000)
"""
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=200,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=True,
    )
    return float(done.stdout)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads Linux's /proc")
def test_thousands_of_environments_and_a_million_fields_take_little_memory() -> None:
    flights = "envs.reset(seed=0)\nfor _ in range(20): envs.step(envs.action_space.sample() / 9)"
    one = resident(f"envs = VectorObstacleField(1, fields=1)\n{flights}")
    thousands = resident(f"envs = VectorObstacleField(2048, fields=4000)\n{flights}")
    million = resident(
        f"envs = VectorObstacleField(2, fields={MAX_FIELDS}, suite='forest')\n{flights}"
    )
    assert thousands < 500.0
    assert thousands - one < 60.0
    assert million - one < 30.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fields": 0}, f"from 1 to {MAX_FIELDS} fields, got fields=0"),
        ({"fields": MAX_FIELDS + 1}, f"got fields={MAX_FIELDS + 1}"),
        ({"fields": 2.5}, r"fields is a number, or the fields to draw from: .*, got 2\.5"),
        ({"fields": None}, "fields is a number, or the fields to draw from: .*, got None"),
        ({"obstacles": -1}, f"0 to {MAX_OBSTACLES} obstacles, got obstacles=-1"),
        ({"obstacles": MAX_OBSTACLES + 1}, f"got obstacles={MAX_OBSTACLES + 1}"),
        ({"obstacles": 7.0}, r"obstacles must be an integer, got 7\.0"),
        ({"suite": "traps", "obstacles": 9}, "obstacles of suite 'traps' are fixed"),
        ({"suite": "traps", "radii": (1, 2)}, "obstacles of suite 'traps' are fixed"),
        ({"suite": "town", "obstacles": 9}, "suite 'town' are fixed; .* changed in standard, sp"),
        ({"suite": "walls", "radii": (1, 2)}, "obstacles of suite 'walls' are fixed"),
        ({"radii": (0.0, 2.0)}, r"0 < smallest <= largest <= 7 m .* got 0\.0 and 2\.0"),
        ({"radii": (3.0, 2.0)}, r"got 3\.0 and 2\.0"),
        ({"radii": (3.0, 7.1)}, r"got 3\.0 and 7\.1"),
        ({"radii": (3.0, np.nan)}, "radii must be finite, got nan"),
        ({"radii": (1.0, 2.0, 3.0)}, r"radii are \(minimum, maximum\), got \(1\.0, 2\.0, 3\.0\)"),
        ({"radii": 3.0}, "radii must have shape"),
        ({"radii": "ab"}, "radii must be an array of numbers, got 'ab'"),
        ({"gate": -0.1}, "need 0 <= gate < shortest, got -0.1 m"),
        ({"gate": 3.0}, "need 0 <= gate < shortest, got 3.0 m"),
        ({"gate": np.nan}, "need 0 <= gate < shortest, got nan m"),
        ({"gate": "1"}, "gate must be a number, got '1'"),
        ({"segments": 0}, "segments from 1 to 10000, got 0"),
        ({"segments": 2.5}, r"segments must be an integer, got 2\.5"),
        ({"observation": "sonar"}, "unknown observation 'sonar'; kinds are discs, rays"),
        ({"nearest": 0}, "nearest from 1 to 10000, got 0"),
        ({"rays": 0}, "rays from 1 to 10000, got 0"),
        ({"rays": True}, "rays must be an integer, got True"),
        ({"focus": -1.0}, r"focus lies between 0 and 30 m ahead, got -1\.0"),
        ({"focus": 30.5}, r"got 30\.5"),
        ({"focus": 8.5, "view": 8.0}, r"focus lies between 0 and 8 m ahead, got 8\.5"),
        ({"view": 0.5}, r"view lies between 1 and 1000 m, got 0\.5"),
        ({"view": np.inf}, "got inf"),
        ({"focus": np.nan}, "got nan"),
        ({"detour": -0.5}, r"penalty detour lies between 0 and 100, got -0\.5"),
        ({"failure": 101}, "penalty failure lies between 0 and 100, got 101"),
        ({"failure": np.nan}, "penalty failure .* got nan"),
        ({"failure": None}, "failure must be a number, got None"),
        ({"capacity": 49}, "fields have up to 50 obstacles, more than capacity=49"),
        ({"obstacles": 9, "capacity": 8}, "up to 9 obstacles, more than capacity=8"),
        ({"suite": "traps", "capacity": 100}, "up to 117 obstacles, more than capacity=100"),
        ({"capacity": MAX_OBSTACLES + 1}, f"got capacity={MAX_OBSTACLES + 1}"),
        ({"capacity": 60.0}, "capacity must be an integer"),
        ({"way": -1}, "need way from 0 to 10000 points, got -1"),
        ({"way": MAX_OBSTACLES + 1}, f"got {MAX_OBSTACLES + 1}"),
        ({"way": 2.0}, r"way must be an integer, got 2\.0"),
        ({"way": True}, "way must be an integer, got True"),
        ({"margin": -0.1}, r"margin lies between 0 and 10 m, got -0\.1"),
        ({"margin": 10.5}, r"got 10\.5"),
        ({"margin": np.nan}, "margin lies between .* got nan"),
        ({"margin": None}, "margin must be a number, got None"),
        ({"progress": "shortest"}, "measured straight or along the way, got 'shortest'"),
        ({"progress": None}, "progress must be a name, got None"),
        ({"reference": 1}, "reference is True or False, got 1"),
    ],
)
def test_settings_that_make_no_sense_are_refused(arguments: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Settings(**arguments)


def test_settings_on_the_edge_are_taken() -> None:
    for arguments in (
        {"gate": 0, "focus": 30, "detour": 0, "failure": 100},
        {"obstacles": 0, "capacity": 0, "nearest": 1},
        {"way": np.int64(1), "margin": 0, "progress": "way"},
        {"way": 40, "margin": 10, "reference": True},
        {"obstacles": 0, "way": 3},
        {"radii": np.array([7.0, 7.0]), "capacity": 50},
        {"fields": np.int64(3), "segments": np.int32(2), "gate": np.float32(0.5)},
    ):
        env = ObstacleField(**{"fields": 2, **arguments})
        seen, _ = env.reset(seed=0)
        assert env.observation_space.contains(seen)
        env.step(np.zeros(4))


@pytest.mark.parametrize("suite", SUITES)
def test_every_field_of_a_suite_has_room(suite: str) -> None:
    settings = Settings(suite=suite)
    most = max(len(settings.drawn(seed)) for seed in range(200))
    assert most <= settings.max_obstacles
    assert suite not in SCATTERED or most == settings.max_obstacles
