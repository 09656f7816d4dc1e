"""Animations: what the frames of a flight tell, and the GIF they become."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from agents.cli.main import main
from agents.flights.flight import Flight, fly
from agents.plots.animation.animation import Painter, animate
from agents.plots.animation.frames import END, MOVE, MOVES, OPENING, Frame, frames_of
from agents.plots.animation.gif import COLOURS, Palette, write_gif
from agents.policies.planner_policies import planner_policy
from agents.runtime.kernels import small_field
from agents.runtime.terminal import Terminal
from ferguson_gym.curves.arc_length import length
from ferguson_gym.rendering.drawing import OBSTACLE, SEEN
from ferguson_gym.rendering.motion import STRIDE
from ferguson_gym.world.field import Field, to_json
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.outcome import Outcome
from planners.interface import Replanner, initial_state
from planners.registry import make

HEAD_ON = Field(
    name="head-on", obstacles=Obstacles.discs([[5, 0]], [5]), start_derivative=np.array([5, 0])
)
"""No flight leaves it: the start touches a disc and faces its centre."""
WALL = Field(
    name="wall", obstacles=Obstacles.discs([[25.0, y] for y in range(-10, 111, 5)], [4] * 25)
)
"""From bound to bound: there is no way to the goal."""
SEARCHERS = ("single-start", "multi-start")
"""They search from initial guesses in every decision."""


@cache
def flown(policy: str, field: Field) -> Flight:
    return fly(planner_policy(make(policy)), field, 0, name=policy)


@pytest.mark.parametrize("policy", SEARCHERS)
def test_decisions_keep_what_was_searched_from(policy: str) -> None:
    planner = make(policy)
    assert isinstance(planner, Replanner)
    decision = planner.decide(small_field(), initial_state(small_field()), 0)
    names = [name for name, _ in decision.candidates]
    assert len(names) == decision.report.starts > 0
    assert decision.report.start in names
    for _, guess in decision.candidates:
        assert guess.shape[1:] == (4, 2)
        np.testing.assert_array_equal(guess[0, 0], small_field().start)
        assert guess.base is None or guess.base.nbytes <= 2 * guess.nbytes
    arrived = flown(policy, small_field()).decisions[-1]
    assert arrived.report.start == "planned"
    assert not arrived.candidates


@pytest.mark.parametrize("policy", SEARCHERS)
def test_each_window_is_a_search_its_plan_and_a_segment_on_the_move(policy: str) -> None:
    flight = flown(policy, small_field())
    assert flight.success
    opening, *windows, end = frames_of(flight)
    assert (opening.seconds, end.seconds) == (OPENING, END)
    searches = [frame for frame in windows if frame.candidates]
    searched = [decision for decision in flight.decisions if decision.candidates]
    assert len(searches) == len(searched) > 0
    for frame, decision in zip(searches, searched, strict=True):
        assert len(frame.candidates) == decision.report.starts
        assert len(frame.plan) == 0
        after = windows[windows.index(frame) + 1]
        np.testing.assert_array_equal(after.plan, decision.chain)
        assert any(after.start is guess for _, guess in decision.candidates)
        np.testing.assert_array_equal(after.position, decision.chain[0, 0])
        np.testing.assert_array_equal(after.origin, after.position)
        assert after.reach == 15.0 * len(decision.chain)
    moves = [frame for frame in windows if frame.seconds == MOVE]
    assert len(windows) == len(moves) + 2 * len(searches)
    np.testing.assert_array_equal(end.flown, flight.control)
    np.testing.assert_array_equal(end.position, flight.field.goal)
    assert f"{flight.length:.2f} m" in end.caption
    assert f"gap {100 * flight.gap:.2f} %" in end.caption


def test_the_vehicle_moves_evenly_along_what_was_flown() -> None:
    flight = flown("guided", small_field())
    moves = [frame for frame in frames_of(flight) if frame.seconds == MOVE]
    positions = np.array([flight.field.start, *(frame.position for frame in moves)])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert steps.min() > 0.5 * STRIDE
    assert steps.max() < 1.6 * STRIDE
    for frame in moves:
        assert not frame.candidates
        np.testing.assert_array_equal(frame.trail[0], flight.control[len(frame.flown), 0])
        np.testing.assert_allclose(frame.trail[-1], frame.position)


def test_a_long_flight_has_longer_strides() -> None:
    flight = flown("single-start", small_field())
    long = replace(flight, control=10.0 * flight.control, decisions=[])
    _, *moves, _ = frames_of(long)
    assert length(long.control).sum() > 2 * STRIDE * MOVES
    assert 0.8 * MOVES <= len(moves) <= 1.2 * MOVES


def test_a_plan_that_is_tracked_is_shown_once_with_its_route() -> None:
    flight = flown("shortest", small_field())
    assert flight.route is not None
    opening, planned, *moves, end = frames_of(flight)
    np.testing.assert_array_equal(opening.route, flight.route.points)
    np.testing.assert_array_equal(planned.plan, flight.decisions[0].chain)
    assert planned.origin is None
    for frame in moves:
        assert frame.seconds == MOVE
        np.testing.assert_array_equal(frame.plan, planned.plan[len(frame.flown) :])
        assert "planned in" in frame.caption
    assert end.route is opening.route


def test_a_flight_that_gives_up_ends_with_what_it_tried() -> None:
    flight = flown("multi-start", HEAD_ON)
    assert flight.outcome is Outcome.GAVE_UP
    *_, end = frames_of(flight)
    assert Outcome.GAVE_UP.sentence in end.caption
    assert len(end.candidates) == flight.decisions[-1].report.starts > 0
    assert "gap" not in end.caption


def test_a_refused_segment_is_shown() -> None:
    flight = flown("single-start", small_field())
    refused = replace(
        flight,
        control=flight.control[:1],
        refused=flight.control[1],
        outcome=Outcome.COLLISION,
        decisions=flight.decisions[:2],
    )
    *_, end = frames_of(refused)
    assert end.refused is refused.refused
    assert len(end.flown) == 1
    assert Outcome.COLLISION.sentence in end.caption


def test_a_policy_that_plans_nothing_is_shown_flying() -> None:
    flight = replace(flown("guided", small_field()), decisions=[])
    _, *moves, end = frames_of(flight)
    assert all(frame.seconds == MOVE and len(frame.plan) == 0 for frame in moves)
    np.testing.assert_array_equal(end.flown, flight.control)


def test_the_program_writes_a_gif(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path, field = tmp_path / "flight.gif", tmp_path / "two discs.json"
    to_json(small_field(), field)
    assert main(["animate", str(field), "--policy", "guided", "--out", str(path)]) == 0
    out, err = capsys.readouterr()
    assert "reached the goal" in out
    assert path.stat().st_size < 500_000
    told = list(frames_of(flown("guided", small_field())))
    assert err == f"wrote {len(told)} frames to {path}\n"
    with Image.open(path) as image:
        assert image.format == "GIF"
        assert image.n_frames == len(told)
        assert image.info["loop"] == 0
        assert 600 <= min(image.size) <= max(image.size) <= 800
        shown = []
        for frame in range(image.n_frames):
            image.seek(frame)
            shown.append(image.info["duration"])
    assert shown == [round(1000 * frame.seconds) for frame in told]
    assert [name.name for name in tmp_path.iterdir() if name.suffix == ".gif"] == ["flight.gif"]


def test_the_vehicle_is_drawn_at_its_position_and_obstacles_in_range_are_darker() -> None:
    field = small_field()
    painter = Painter(field, "title")
    frame = Frame(
        seconds=1.0, caption="", position=np.array([80.0, 20.0]), heading=np.array([1.0, 0.0])
    )
    far, looking = (
        painter.paint(frame),
        painter.paint(replace(frame, origin=field.start, reach=20.0)),
    )

    def at(frame: np.ndarray, x: float, y: float) -> tuple[int, ...]:
        column, row = 8 + 720 * (x + 10) / 120, 8 + 720 * (110 - y) / 120
        return tuple(int(part) for part in frame[round(row), round(column)])

    def rgb(colour: str) -> tuple[int, ...]:
        return tuple(bytes.fromhex(colour[1:]))

    assert at(far, 80.2, 20.0) == (0, 0, 0)
    assert at(far, 9.0, 9.0) == at(far, 30.0, 24.0) == rgb(OBSTACLE)
    assert at(looking, 9.0, 9.3) == rgb(SEEN)
    assert at(looking, 30.0, 24.0) == rgb(OBSTACLE)
    # the nearer to the goal, the darker the band
    assert sum(at(far, 44.0, 41.0)) < sum(at(far, 70.0, 80.0)) < sum(at(far, 105.0, 105.0))


@pytest.mark.parametrize(
    ("policy", "field"),
    [
        ("single-start", HEAD_ON),
        ("shortest", WALL),
        (
            "guided",
            Field(
                name="$odd [name] " + "long " * 30,
                obstacles=Obstacles.discs([], []),
                goal=np.array([20.0, 0.0]),
                bounds=np.array([[-5.0, -3.0], [25.0, 3.0]]),
            ),
        ),
    ],
)
def test_any_flight_can_be_animated(policy: str, field: Field, tmp_path: Path) -> None:
    path = tmp_path / "flight.gif"
    with Terminal().still_bar() as progress:
        frames = animate(flown(policy, field), path, progress)
    with Image.open(path) as image:
        assert image.n_frames == frames


def test_large_areas_keep_their_colours_and_rare_strong_ones_are_there() -> None:
    frame = np.full((200, 200, 3), 250, np.uint8)
    for row in range(16):
        frame[10 * row : 10 * row + 10] = (250 - row, 251, 250 - 2 * row)
    frame[3:6, 3:6] = (200, 30, 40)
    noise = np.random.default_rng(0).integers(0, 255, (20, 200, 3), np.uint8)
    frame[180:] = noise
    shown = np.asarray(Palette([frame])(frame).convert("RGB"))
    np.testing.assert_array_equal(shown[10:160], frame[10:160])
    assert np.abs(shown[4, 4].astype(int) - (200, 30, 40)).max() <= 20
    assert len(np.unique(shown.reshape(-1, 3), axis=0)) <= COLOURS


def test_an_animation_that_fails_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "flight.gif"
    path.write_text("older")
    frame = np.zeros((8, 8, 3), np.uint8)

    def frames_of() -> Iterator[np.ndarray]:
        yield frame
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_gif(path, frames_of(), [1.0, 1.0], Palette([frame]))
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("field", "policy", "out", "message"),
    [
        ("paper:9", "guided", "a.gif", "the paper has fields 1 to 4, not 9"),
        ("paper:1-4", "guided", "a.gif", "names more than one field"),
        ("paper:1", "nobody", "a.gif", "unknown policy 'nobody'; policies are single-start"),
        ("paper:1", "guided", "a.mp4", "animations are written as .gif, not 'a.mp4'"),
        ("paper:1", "guided", "no/a.gif", "no such directory for the animation"),
        ("paper:1", "guided", "taken.gif", "is a directory"),
    ],
)
def test_bad_input_is_one_line_and_status_two(
    field: str,
    policy: str,
    out: str,
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    (tmp_path / "taken.gif").mkdir()
    assert main(["animate", field, "--policy", policy, "--out", str(tmp_path / out)]) == 2
    printed, err = capsys.readouterr()
    assert printed == ""
    assert err.count("\n") == 1
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["taken.gif"]


def test_what_a_planner_did_not_know_stays_pale() -> None:
    field = get_field("standard/train:0")
    flight = fly("guided+sensing=20", field, 0)
    counts = [len(frame.known.obstacles) for frame in frames_of(flight) if frame.known is not None]
    assert counts == sorted(counts)
    assert 0 < counts[0] < counts[-1] <= len(field.obstacles)
    searching = planner_policy(make("multi-start+sensing=20"))
    assert fly(searching, field, 0, name="multi-start+sensing=20").decisions[0].candidates
