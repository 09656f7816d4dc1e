"""Pictures for notebooks: what they show is what there is, and animations keep their times."""

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
import pytest

from agents.flights import Flight, fly
from ferguson_gym import get_field
from ferguson_gym.curves import Path, evaluate
from ferguson_gym.svg.axes import PIXELS, UNITS
from ferguson_gym.svg.colours import GOAL, OBSTACLE, REFUSED, SEGMENTS, START
from ferguson_gym.world import Field, Obstacles, Outcome
from planners import Plan, Status, make
from planners.interface import initial_state

NS = "{http://www.w3.org/2000/svg}"
FIELD = get_field("paper:3")
T = np.linspace(0.0, 1.0, 20)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make("guided").plan(FIELD, initial_state(FIELD), 0)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return fly("guided", FIELD)


def parsed(shown: Any) -> ElementTree.Element:
    return ElementTree.fromstring(shown._repr_svg_())


def caption(shown: Any) -> str:
    root = parsed(shown)
    title = root.find(f"{NS}title").text
    assert title == root.findall(f"{NS}text")[-1].text
    return title


def strokes(shown: Any, colour: str) -> list[ElementTree.Element]:
    return [path for path in parsed(shown).iter(f"{NS}path") if path.get("stroke") == colour]


def curves(data: str) -> list[np.ndarray]:
    """Bézier points (4, 2) of the cubic curves in path data."""
    found: list[np.ndarray] = []
    point = tip = np.zeros(2)
    for command, words in re.findall(r"([Mcs])([^Mcs]*)", data):
        numbers = np.array(re.findall(r"-?\d+", words), float).reshape(-1, 2)
        if command == "M":
            point = numbers[0]
            continue
        first = [point + numbers[0]] if command == "c" else [2.0 * point - tip]
        tip, end = point + numbers[-2], point + numbers[-1]
        found.append(np.stack([point, *first, tip, end]))
        point = end
    return found


def metres(points: np.ndarray, field: Field = FIELD) -> np.ndarray:
    """Points (..., 2) of a picture of a field."""
    low, high = field.bounds
    scale = (high - low).max() / UNITS
    return np.array([low[0], high[1]]) + scale * points * (1.0, -1.0)


def bezier(points: np.ndarray, t: np.ndarray = T) -> np.ndarray:
    s = t[:, None]
    weights = (1 - s) ** 3, 3 * s * (1 - s) ** 2, 3 * s**2 * (1 - s), s**3
    return sum(w * point for w, point in zip(weights, points, strict=True))


def test_a_field_shows_its_discs_start_goal_and_name() -> None:
    root = parsed(FIELD)
    circles = [
        [float(circle.get(key)) for key in ("cx", "cy", "r")] for circle in root.iter(f"{NS}circle")
    ]
    discs, start = np.array(circles[:-1]), circles[-1]
    assert FIELD.obstacles.are_discs
    assert np.abs(metres(discs[:, :2]) - FIELD.obstacles.centers).max() < 0.01
    assert np.abs(120.0 / UNITS * discs[:, 2] - FIELD.obstacles.radii).max() < 0.01
    assert metres(np.array(start[:2])) == pytest.approx(FIELD.start, abs=0.01)
    (star,) = root.iter(f"{NS}polygon")
    corners = np.array(re.findall(r"-?\d+", star.get("points")), float).reshape(-1, 2)
    assert metres(corners.mean(axis=0)) == pytest.approx(FIELD.goal, abs=0.01)
    assert [list(root.iter(f"{NS}circle"))[-1].get("fill"), star.get("fill")] == [START, GOAL]
    assert caption(FIELD) == f"paper:3: {len(FIELD.obstacles)} obstacles"
    numbers = [text.text for text in root.iter(f"{NS}text")]
    assert numbers[:-1] == ["0", "20", "40", "60", "80", "100"] * 2


def test_a_field_shows_obstacles_of_every_shape() -> None:
    shapes = Obstacles.joined(
        [
            Obstacles.discs([[30.0, 30.0]], [5.0]),
            Obstacles.boxes([[50.0, 20.0]], [[60.0, 40.0]]),
            Obstacles.capsules([[[20.0, 70.0], [40.0, 80.0]]], 2.0),
        ]
    )
    root = parsed(Field(name="mixed", obstacles=shapes))
    (group,) = (part for part in root.iter(f"{NS}g") if part.get("fill") == OBSTACLE)
    disc, box, capsule = group
    assert disc.tag == f"{NS}circle"
    corners = np.cumsum(np.array(re.findall(r"-?\d+", box.get("d")), float).reshape(-1, 2), axis=0)
    np.testing.assert_allclose(metres(corners), shapes.core(1), atol=0.01)
    assert capsule.get("d").count("a") == 4


def test_a_plan_shows_its_segments_exactly(plan: Plan) -> None:
    for parity, colour in enumerate(SEGMENTS):
        (path,) = strokes(plan, colour)
        drawn = curves(path.get("d"))
        flown = plan.control[parity::2]
        assert len(drawn) == len(flown)
        for points, control in zip(drawn, flown, strict=True):
            assert np.abs(metres(bezier(points)) - evaluate(control, T)).max() < 0.02
    length = plan.path.length
    assert caption(plan) == (
        f"paper:3: {len(plan.control)} segments, {length:.2f} m, found a feasible path to the goal"
    )
    assert len(list(parsed(plan).iter(f"{NS}circle"))) == len(
        list(parsed(FIELD).iter(f"{NS}circle"))
    ) + len(plan.control)


def test_a_plan_shows_what_it_knows() -> None:
    routed = make("voronoi").plan(FIELD, initial_state(FIELD), 0)
    corners = 1 + len(re.findall("l", strokes(routed, "#8e44ad")[0].get("d")))
    assert routed.route is not None
    assert corners == len(routed.route.points)
    alone = replace(routed, field=None, route=None)
    assert caption(alone).startswith(f"{len(alone.control)} segments, ")
    nothing = replace(alone, control=np.empty((0, 4, 2)), status=Status.STUCK)
    assert nothing._repr_svg_() is None
    with pytest.raises(ValueError, match="neither a field nor segments"):
        nothing.picture()
    failed = replace(nothing, field=FIELD)
    assert (
        caption(failed)
        == "paper:3: 0 segments, 0.00 m, found no feasible chain from the current state"
    )
    assert not strokes(failed, SEGMENTS[0])


def test_a_flight_shows_its_refused_segment_and_its_outcome(flight: Flight) -> None:
    assert caption(flight) == (
        f"guided on paper:3: {len(flight.control)} segments, {flight.length:.2f} m, "
        f"gap {100.0 * flight.gap:.2f} %, reached the goal"
    )
    assert not strokes(flight, REFUSED)
    refused = flight.control[-1]
    crashed = replace(
        flight, control=flight.control[:-1], refused=refused, outcome=Outcome.COLLISION
    )
    (path,) = strokes(crashed, REFUSED)
    (points,) = curves(path.get("d"))
    assert np.abs(metres(bezier(points)) - evaluate(refused, T)).max() < 0.02
    assert caption(crashed).endswith(" m, cut into an obstacle")


def test_the_text_beside_a_picture_is_short(plan: Plan) -> None:
    shown = plan._repr_mimebundle_(include=None, exclude=None)
    assert shown["image/svg+xml"] == plan._repr_svg_()
    assert shown["text/plain"] == f"<Plan: {caption(plan)}>"


def test_a_path_fills_its_picture() -> None:
    bend = Path([[[0.0, 0.0], [9.0, 3.0], [9.0, 0.0], [9.0, 6.0]]])
    assert caption(bend) == "1 segment, 9.628 m"
    (path,) = strokes(bend, SEGMENTS[0])
    (points,) = curves(path.get("d"))
    assert np.ptp(bezier(points)[:, 0]) == pytest.approx(UNITS / 1.1, rel=0.01)


def at(animate: ElementTree.Element, seconds: float) -> float:
    """The value of an animated attribute."""
    time = seconds / float(animate.get("dur").removesuffix("s"))
    values, times = (np.array(animate.get(key).split(";"), float) for key in ("values", "keyTimes"))
    if animate.get("calcMode") == "discrete":
        return float(values[np.flatnonzero(times <= time)[-1]])
    assert (np.diff(times) >= 0.0).all()
    assert [times[0], times[-1]] == [0.0, 1.0]
    return float(np.interp(time, times, values))


@pytest.mark.parametrize("kind", ["path", "plan", "flight"])
def test_an_animation_flies_at_a_constant_speed(kind: str, plan: Plan, flight: Flight) -> None:
    shown: Any = {"path": plan.path, "plan": plan, "flight": flight}[kind]
    picture = shown.animate(seconds=8.0)
    trails = sorted(
        (path for colour in SEGMENTS for path in strokes(picture, colour)),
        key=lambda path: float(path.find(f"{NS}animate").get("keyTimes").split(";")[1]),
    )
    lengths = [
        np.linalg.norm(
            np.diff(bezier(curves(path.get("d"))[0], np.linspace(0, 1, 500)), axis=0), axis=1
        ).sum()
        for path in trails
    ]
    for seconds in (0.0, 2.0, 6.5, 8.0, 9.5):
        seen = 0.0
        for path, length in zip(trails, lengths, strict=True):
            offset, opacity = path.findall(f"{NS}animate")
            dash = float(path.get("stroke-dasharray"))
            assert dash > length  # the whole line is one dash, so still pictures are complete
            # nothing shows before its time, and the dash grows with a lag of its excess
            grown = (dash - at(offset, seconds)) / dash * length
            seen += at(opacity, seconds) * grown
        assert seen == pytest.approx(min(seconds / 8.0, 1.0) * sum(lengths), rel=0.005, abs=1.0)
    (motion,) = parsed(picture).iter(f"{NS}animateMotion")
    assert motion.get("dur") == "10s"
    assert motion.get("keyPoints") == "0;1;1"
    assert motion.get("keyTimes") == "0;0.80000;1"
    assert len(curves(motion.get("path"))) == len(trails)


def test_the_refused_segment_appears_at_the_end(flight: Flight) -> None:
    crashed = replace(flight, control=flight.control[:3], refused=flight.control[3])
    (path,) = strokes(crashed.animate(4.0), REFUSED)
    assert [at(path[0], seconds) for seconds in (0.0, 3.9, 4.1)] == [0.0, 0.0, 1.0]
    still = replace(crashed, control=flight.control[:0])
    assert not list(parsed(still.animate()).iter(f"{NS}animateMotion"))


@pytest.mark.parametrize("seconds", [0.0, -1.0, np.nan, np.inf])
def test_a_duration_is_positive(seconds: float, flight: Flight) -> None:
    with pytest.raises(ValueError, match="a number of seconds above 0"):
        flight.animate(seconds)


def balls() -> Field:
    obstacles = Obstacles.discs([[5.0, 5.0, 5.0]], [1.0])
    return Field(name="balls", obstacles=obstacles, start=np.zeros(3), goal=np.full(3, 10.0))


@pytest.mark.parametrize(
    "make_one",
    [balls, lambda: Path([[[0.0] * 3, [9.0] * 3, [9.0] * 3, [9.0] * 3]])],
    ids=["field", "path"],
)
def test_what_is_not_planar_has_no_picture(make_one: Callable[[], Any]) -> None:
    one = make_one()
    assert one._repr_svg_() is None
    assert one._repr_mimebundle_() == {}  # notebooks print the text
    with pytest.raises(ValueError, match=r"pictures are planar, .* has 3 dimensions"):
        one.picture()


@pytest.mark.parametrize(
    ("low", "high"), [((0, 0), (1e-6, 1e-6)), ((-5, -5), (5, 1e6)), ((1e7, 0), (1e7 + 3, 0.1))]
)
def test_fields_of_every_scale_fit(low: tuple[float, float], high: tuple[float, float]) -> None:
    ends = np.linspace(low, high, 5)
    radius = 0.01 * min(np.subtract(high, low))
    field = Field(
        name="<&> 'quoted'",
        obstacles=Obstacles.discs([ends[2]], [radius]),
        start=ends[1],
        goal=ends[3],
        bounds=np.array([low, high]),
    )
    root = parsed(field)
    width, height = float(root.get("width")), float(root.get("height"))
    assert PIXELS < max(width, height) < 1.3 * PIXELS
    assert caption(field) == "<&> 'quoted': 1 obstacle"
    for text in root.iter(f"{NS}text"):
        assert -5.0 * UNITS < float(text.get("x")) <= UNITS


def test_a_path_that_stands_still_has_a_picture() -> None:
    still = Path(np.zeros((2, 4, 2)))
    assert "2 segments, 0 m" in still._repr_svg_()
    assert "animateMotion" in still.animate()._repr_svg_()


def test_pictures_are_saved_as_svg(tmp_path: File) -> None:
    picture = FIELD.picture()
    picture.save(tmp_path / "field.svg")
    assert (tmp_path / "field.svg").read_text() == picture._repr_svg_() + "\n"
    assert repr(picture) == f"<Picture: {picture.caption}>"
    with pytest.raises(ValueError, match=r"saved as \.svg, not 'field\.png'"):
        picture.save("field.png")
