"""Contacts with corners, edges and arcs of obstacles, against definitions and differences."""

import numpy as np
import pytest

from ferguson_gym.curves.splines import evaluate
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.optimization.sqp.contacts import NEAR
from planners.optimization.window import Window, WindowSettings, horizon_window
from tests.support.expanded_windows import NUMBERS, Expanded, expanded
from tests.support.random_shapes import window_among_shapes

KINDS = {
    "a corner": lambda c: (c["inverse"] > 0.0) & (c["drift"] != 0.0),
    "an edge": lambda c: (c["inverse"] == 0.0) & (c["drift"] != 0.0),
    "a crossing": lambda c: c["inverse"] < 0.0,
    "a fixed parameter": lambda c: (c["drift"] == 0.0) & (c["clearance"] > -0.5),
}
SHAPES = ("polygons", "rounded", "capsules")
BOX = Obstacles.boxes([[6.0, -3.0]], [[8.0, 1.0]])
WALL = Obstacles.capsules([[[7.0, -5.0], [7.0, 1.0]]], 0.25)


def drawn(seed: int, kinds: tuple[str, ...] = SHAPES) -> Expanded:
    window, guess = window_among_shapes(seed, 60, kinds=kinds)
    return expanded(window, np.clip(window.chain.unknowns(guess), *window.box))


def straight(obstacles: Obstacles, height: float, rise: float = 0.0, end: float = 12.0) -> Expanded:
    """A segment to the right through or beside obstacles, of constant speed."""
    field = Field(name="one", obstacles=obstacles, start=[0.0, height], goal=[40.0, 0.0])
    way = np.array([end, rise])
    window = horizon_window(field, State(field.start, way), WindowSettings(), 1)
    return expanded(window, np.concatenate([field.start + way, way]))


def shapes(here: Expanded) -> np.ndarray:
    """Which contacts are with obstacles, discs included."""
    return np.asarray(here.contact["what"] >= 0)


def numbers(here: Expanded) -> tuple[np.ndarray, ...]:
    return (here.contact["segment"], here.contact["what"], np.sign(here.contact["inverse"]))


def central_differences(here: Expanded) -> tuple[np.ndarray, np.ndarray] | None:
    """Of clearances and of their gradients; None where a contact comes, goes or jumps."""
    first, second, step = [], [], 1e-6
    for along in step * np.eye(len(here.x)):
        sides = [expanded(here.window, here.x + way) for way in (along, -along)]
        for side in sides:
            if side.count != here.count or abs(side.contact["t"] - here.contact["t"]).max() > 1e-3:
                return None
            if not all(map(np.array_equal, numbers(side), numbers(here))):
                return None
        up, down = sides
        first.append((up.contact["clearance"] - down.contact["clearance"]) / (2.0 * step))
        second.append((up.slope - down.slope) / (2.0 * step))
    return np.stack(first, axis=-1), np.stack(second, axis=-1)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("kind", KINDS)
def test_gradients_and_hessians_agree_with_differences(kind: str, shape: str) -> None:
    checked = 0
    for seed in range(400):
        here = drawn(seed, (shape,))
        chosen = shapes(here) & KINDS[kind](here.contact) & (abs(here.contact["drift"]) < 1.0)
        if not chosen.any() or (expected := central_differences(here)) is None:
            continue
        first, second = expected
        np.testing.assert_allclose(here.slope[chosen], first[chosen], atol=1e-6)
        flat, _ = np.zeros(len(here.out.length)), here.window
        _, without = here.gradient_and_hessian(flat, np.zeros(here.count))
        for row in np.flatnonzero(chosen):
            multiplier = np.zeros(here.count)
            multiplier[row] = 1.0
            _, hessian = here.gradient_and_hessian(flat, multiplier)
            got, size = without - hessian, 1.0 + abs(second[row]).max()
            np.testing.assert_allclose(got, second[row], atol=1e-5 * size)
            checked += 1
        if checked >= 5:
            return
    pytest.fail(f"only {checked} contacts found")


@pytest.mark.parametrize("seed", range(60))
def test_a_clearance_is_the_distance_or_less_where_a_core_is_crossed(seed: int) -> None:
    here = drawn(seed)
    control, contact = here.out.control, here.contact[shapes(here)]
    for one in contact:
        point = evaluate(control[one["segment"]], [one["t"]])[0]
        distance = here.window.obstacles.signed_distance(point)[one["what"]]
        if one["inverse"] > 0.0 or (one["inverse"] == 0.0 and one["drift"] != 0.0):
            assert one["clearance"] == pytest.approx(distance, abs=1e-9)
        elif one["inverse"] < 0.0:
            assert one["clearance"] <= -here.window.obstacles.radii[one["what"]]
    np.testing.assert_allclose(np.linalg.norm(contact["normal"], axis=1), 1.0, rtol=1e-12)


@pytest.mark.parametrize("seed", range(60))
def test_no_nearest_point_within_reach_is_missed(seed: int) -> None:
    here, behind = drawn(seed), 2001 // 16
    points = evaluate(here.out.control, np.linspace(0.0, 1.0, 2001))
    obstacles = here.window.obstacles
    sampled = obstacles.signed_distance(points).reshape(-1, len(obstacles))
    for k in range(len(obstacles)):
        nearest = sampled[:, k].argmin()
        if nearest > behind and sampled[nearest, k] < 5.0:
            found = here.contact["clearance"][here.contact["what"] == k]
            # up to the kink that a crossing has within its bracket
            assert found.min() <= sampled[nearest, k] + 1e-6


@pytest.mark.parametrize("obstacles", [BOX, WALL, BOX.grown(np.array([0.5]))])
@pytest.mark.parametrize("rise", [0.0, 2.0, -3.0])
def test_a_segment_moves_smoothly_across_a_corner(obstacles: Obstacles, rise: float) -> None:
    """From inside to outside, the clearance grows with the distance from the corner's line."""
    found = []
    heights = np.linspace(-0.4, 0.6, 41)
    for height in heights:
        here = straight(obstacles, 1.0 + height - rise * 7.0 / 12.0, rise)
        (moving,) = here.contact[shapes(here) & (here.contact["drift"] != 0.0)]
        found.append(moving["clearance"])
    # the upper right corner of the box, or the left one, is the last to be passed
    corners = obstacles.points - np.array([7.0, 1.0])
    size = np.hypot(12.0, rise)
    highest = (12.0 * corners[:, 1] - rise * corners[:, 0]).max() / size
    expected = 12.0 * heights / size - highest - obstacles.radii[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("height", [-2.2, 0.5, 0.999999, 1.0, 1.000001])
def test_where_a_wall_is_crossed_the_way_out_is_its_nearer_end(height: float) -> None:
    here = straight(WALL, height)
    (crossing,) = here.contact[shapes(here) & (here.contact["inverse"] != 0.0)]
    nearer, side = min((1.0 - height, 1.0), (height + 5.0, -1.0))
    assert crossing["clearance"] == pytest.approx(-nearer - 0.25)
    np.testing.assert_allclose(crossing["normal"], [0.0, side], atol=1e-12)
    assert crossing["t"] == pytest.approx(7.0 / 12.0)


def test_a_segment_along_an_edge_has_contacts_everywhere() -> None:
    here = straight(BOX, 1.0 + 0.5 * NEAR)
    contact = here.contact[shapes(here)]
    t = np.arange(1, 17) / 16
    beside = (12.0 * t > 6.0) & (12.0 * t < 8.0)
    assert set(contact["t"][contact["drift"] == 0.0]) >= set(t[beside])
    np.testing.assert_allclose(contact["clearance"].min(), 0.5 * NEAR, atol=1e-12)


@pytest.mark.parametrize("t", [0.0, 0.3, 7.0 / 12.0, 1.0])
@pytest.mark.parametrize("height", [0.2, 1.5])
@pytest.mark.parametrize("obstacles", [BOX, WALL])
def test_what_certification_adds_is_a_contact(
    obstacles: Obstacles, height: float, t: float
) -> None:
    plain = straight(obstacles, height)
    pinned = np.array([[0.0, 0.0, t]])
    here = expanded(plain.window, plain.x, reach=1e3, pinned_contacts=pinned)
    without = expanded(plain.window, plain.x, reach=1e3)
    assert here.count == without.count + 1
    added = here.contact[shapes(here)][-1]
    assert added["t"] == t or added["inverse"] < 0.0
    (point,) = evaluate(here.out.control[0], [t])
    assert added["clearance"] <= obstacles.signed_distance(point)[0] + 1e-9


def test_a_disc_among_shapes_has_the_contacts_of_a_disc() -> None:
    for seed in range(20):
        window, guess = window_among_shapes(seed, 40, kinds=("discs",))
        x = np.clip(window.chain.unknowns(guess), *window.box)
        alone = expanded(window, x)
        far = Obstacles.boxes([[1e4, 1e4]], [[2e4, 2e4]])
        mixed = Window(
            chain=window.chain,
            objective=window.objective,
            field=window.field,
            obstacles=Obstacles.joined([window.obstacles, far]),
            samples=window.samples,
            bending_weight=window.bending_weight,
        )
        here = expanded(mixed, x)
        for name in NUMBERS:
            np.testing.assert_array_equal(here.contact[name], alone.contact[name])
        np.testing.assert_array_equal(here.slope, alone.slope)
