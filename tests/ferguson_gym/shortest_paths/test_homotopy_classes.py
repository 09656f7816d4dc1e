"""The best classes: in order, different, complete, and each by its shortest path."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.sparse.csgraph import connected_components

from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.shortest_paths.homotopy_classes import best_classes, classes
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from tests.support.taut_paths import assert_is_taut, fields, random_field


def word(path: ShortestPath, discs: Obstacles) -> tuple[int, ...]:
    """The class of a path: a reduced word of the rays it crosses, one upward from each cluster.

    Discs that overlap or touch are a cluster; rays start at the centre of its first disc.
    """
    apart = np.linalg.norm(discs.centers[:, None] - discs.centers, axis=-1)
    _, cluster_of = connected_components(apart <= discs.radii[:, None] + discs.radii)
    points = path.points(0.05)
    x, y = points.T
    crossed = []
    for cluster in np.unique(cluster_of, return_index=True)[1]:
        ray_x, ray_y = discs.centers[cluster] + [1e-7 * math.pi, 0.0]
        steps = np.flatnonzero((x[:-1] > ray_x) != (x[1:] > ray_x))
        share = (ray_x - x[steps]) / (x[steps + 1] - x[steps])
        above = y[steps] + share * (y[steps + 1] - y[steps]) > ray_y
        sign = np.where(x[steps + 1] > x[steps], 1, -1)
        crossed += [
            (k, f, s * (cluster + 1))
            for k, f, s in zip(steps[above], share[above], sign[above], strict=True)
        ]
    letters: list[int] = []
    for *_, letter in sorted(crossed):
        if letters and letters[-1] == -letter:
            letters.pop()
        else:
            letters.append(int(letter))
    return tuple(letters)


def crosses_itself(path: ShortestPath) -> bool:
    a, b = path.lines[:, None, 0], path.lines[:, None, 1]
    c, d = path.lines[None, :, 0], path.lines[None, :, 1]

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return (q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0]

    apart = (side(a, b, c) * side(a, b, d) < -1e-6) & (side(c, d, a) * side(c, d, b) < -1e-6)
    return bool(apart.any())


def assert_classes(paths: list[ShortestPath], field: Field) -> None:
    for path in paths:
        assert_is_taut(path, field)
        assert not crosses_itself(path)
        assert (path.sweeps >= 1e-7).all()
    lengths = [path.length for path in paths]
    assert lengths == sorted(lengths)
    shortest = shortest_path(field)
    if shortest is None:
        assert paths == []
    else:
        assert lengths[0] == pytest.approx(shortest.length, rel=1e-9)


@pytest.mark.parametrize("suite", ["standard", "sparse", "dense", "forest", "traps"])
def test_classes_of_the_suites_are_different_and_in_order(suite: str) -> None:
    for field in get_fields(f"{suite}/validation:0-4"):
        paths = best_classes(field, field.start, 12)
        assert len(paths) == 12
        assert_classes(paths, field)
        assert field.obstacles.are_discs
        assert len({word(path, field.obstacles) for path in paths}) == 12


@pytest.mark.parametrize("seed", range(10))
def test_among_overlapping_discs_classes_are_different(seed: int) -> None:
    field = random_field(seed, 14, largest=12.0)
    discs = field.obstacles
    assert discs.are_discs
    # a cluster on the bounds is part of the outside, and no class goes round it
    inside = (
        (discs.centers - discs.radii[:, None] > -10) & (discs.centers + discs.radii[:, None] < 110)
    ).all(axis=1)
    discs = Obstacles.discs(discs.centers[inside], discs.radii[inside])
    field = Field(name="inside", obstacles=discs)
    paths = best_classes(field, field.start, 15)
    assert_classes(paths, field)
    assert len({word(path, discs) for path in paths}) == len(paths)


def test_one_disc_has_two_sides() -> None:
    discs = Obstacles.discs([[50.0, 53.0]], [10.0])
    field = Field(name="one", obstacles=discs, start=(0, 50), goal=(100, 50))
    below, above = best_classes(field, field.start, 5)
    assert below.senses.tolist() == [1]
    assert above.senses.tolist() == [-1]
    tangents = math.hypot(50.0, 3.0) ** 2 - 100.0
    sweep = 2.0 * math.asin(50.0 / math.hypot(50.0, 3.0)) - 2.0 * math.acos(
        10.0 / math.hypot(50.0, 3.0)
    )
    assert below.length == pytest.approx(2.0 * math.sqrt(tangents) + 10.0 * sweep)
    sweep += 4.0 * math.atan2(3.0, 50.0)
    assert above.length == pytest.approx(2.0 * math.sqrt(tangents) + 10.0 * sweep)


def test_two_touching_discs_have_a_gap_between_them() -> None:
    touching = Obstacles.discs([[50.0, 40.0], [50.0, 60.0]], [10.0, 10.0])
    field = Field(name="touching", obstacles=touching, start=(0, 50), goal=(100, 50))
    straight, *rest = best_classes(field, field.start, 3)
    assert straight.length == 100.0
    assert [path.senses.tolist() for path in rest] in ([[1], [-1]], [[-1], [1]])
    assert rest[0].length == pytest.approx(rest[1].length)
    closed = Field(
        name="closed",
        obstacles=Obstacles.discs(touching.centers, [10.0, 10.001]),
        start=(0, 50),
        goal=(100, 50),
    )
    assert len(best_classes(closed, field.start, 9)) == 2


def test_a_disc_smaller_than_the_margin_has_no_sides() -> None:
    field = Field(name="grain", obstacles=Obstacles.discs([[50.0, 50.0]], [1e-8]))
    assert len(best_classes(field, field.start, 5)) == 1


def test_a_side_closed_by_the_bounds_is_not_a_class() -> None:
    discs = Obstacles.discs([[50.0, 105.0]], [20.0])
    field = Field(name="closed", obstacles=discs)
    assert len(best_classes(field, field.start, 5)) == 1


def test_a_row_with_a_common_tangent_has_one_class_along_it() -> None:
    row = Obstacles.discs([[x, 40.0] for x in range(10, 100, 20)], [10.0] * 5)
    field = Field(name="row", obstacles=row, start=(0, 50), goal=(100, 50))
    paths = best_classes(field, field.start, 8)
    assert_classes(paths, field)
    assert paths[0].length == 100.0
    assert paths[1].length > 100.5
    # discs touch: a ray from each, not one from all
    kinds = {tuple((path.discs * path.senses).tolist()) for path in paths}
    assert len(kinds) == len(paths)


@pytest.mark.parametrize("seed", range(20))
def test_a_full_turn_around_a_thin_disc_is_not_a_class(seed: int) -> None:
    # cheap as it is; rounding may also place the end of a tangent just behind its start
    stream = np.random.default_rng(seed)
    turn = stream.uniform(0.0, 1.5)
    along, left = (
        np.array([math.cos(turn), math.sin(turn)]),
        np.array([-math.sin(turn), math.cos(turn)]),
    )
    radii = stream.uniform(1e-3, 1e-2, 4)
    centers = np.sort(stream.uniform(5.0, 95.0, 4))[:, None] * along - radii[:, None] * left
    field = Field(name="thin", obstacles=Obstacles.discs(centers, radii), goal=100.0 * along)
    paths = best_classes(field, field.start, 40)
    assert_classes(paths, field)
    assert len(paths) == 40
    assert max(path.sweeps.max(initial=0.0) for path in paths) < 4.0
    ways = {tuple(zip(path.discs.tolist(), path.senses.tolist(), strict=True)) for path in paths}
    assert len(ways) == 40


def test_a_straight_start_on_a_disc_is_not_a_full_turn() -> None:
    for seed in range(250):  # rounding matters in one of fifty
        turn = np.random.default_rng(seed).uniform(0.0, 1.5)
        along = np.array([math.cos(turn), math.sin(turn)])
        left = np.array([-math.sin(turn), math.cos(turn)])
        # the start is where the common tangent leaves the first disc
        discs = Obstacles.discs([0.01 * left, 40.0 * along + 3.0 * left], [0.01, 3.0])
        try:
            field = Field(name="on", obstacles=discs, goal=70.0 * along + 20.0 * left)
        except ValueError:  # by rounding, the start is in the disc
            continue
        for path in best_classes(field, field.start, 8):
            assert path.sweeps.max() < 2.0 * math.pi - 1e-7


def test_without_a_path_there_is_no_class() -> None:
    wall = Obstacles.discs([[50.0, y] for y in range(-10, 111, 5)], [4.0] * 25)
    assert best_classes(Field(name="wall", obstacles=wall), (0.0, 0.0), 3) == []
    assert best_classes(Field(name="wall", obstacles=wall), (50.0, 50.0), 3) == []


@pytest.mark.parametrize("k", [0, -1])
def test_at_least_one_class_must_be_asked_for(k: int) -> None:
    with pytest.raises(ValueError, match=f"at least 1 class must be asked for, got {k}"):
        best_classes(get_field("paper:1"), (0.0, 0.0), k)


def lengths_by_trial(field: Field, turns: int) -> list[float]:
    """Lengths of all taut paths with a few turns, by trying every sequence of discs and senses."""
    discs = field.obstacles
    assert discs.are_discs
    centers = np.vstack([discs.centers, field.start, field.goal])
    radii = np.concatenate([discs.radii, [0.0, 0.0]])
    n = len(discs)
    lengths = []
    places = list(itertools.product(range(n), (1, -1)))
    for number in range(turns + 1):
        for middle in itertools.permutations(places, number):
            way = [(n, 0), *middle, (n + 1, 0)]
            lines, directions = [], []
            for (i, s), (j, t) in itertools.pairwise(way):
                # an angle whose left normal is s r, t r before the centres
                apart = centers[j] - centers[i]
                distance, shift = np.hypot(*apart), t * radii[j] - s * radii[i]
                if i == j or abs(shift) > distance:
                    break
                turn = math.atan2(apart[1], apart[0]) - math.asin(shift / distance)
                normal = np.array([-math.sin(turn), math.cos(turn)])
                lines.append(
                    (centers[i] - s * radii[i] * normal, centers[j] - t * radii[j] * normal)
                )
                directions.append(turn)
            else:
                sweeps = [
                    s * (after - before) % (2 * math.pi)
                    for (_, s), (before, after) in zip(
                        middle, itertools.pairwise(directions), strict=True
                    )
                ]
                samples = np.concatenate(
                    [a + np.linspace(0, 1, 200)[:, None] * (b - a) for a, b in lines]
                )
                path = ShortestPath(
                    length=0.0,
                    lines=np.array(lines),
                    discs=np.empty(0, dtype=int),
                    senses=np.empty(0, dtype=int),
                    centers=np.empty((0, 2)),
                    radii=np.empty(0),
                    angles=np.empty((0, 2)),
                )
                if discs.signed_distance(samples).min() > -1e-3 and not crosses_itself(path):
                    arcs = sum(
                        radii[i] * sweep for (i, _), sweep in zip(middle, sweeps, strict=True)
                    )
                    lengths.append(sum(math.dist(*line) for line in lines) + arcs)
    return sorted(lengths)


@pytest.mark.parametrize("seed", range(6))
def test_no_class_is_missed(seed: int) -> None:
    stream = np.random.default_rng(seed)
    while True:
        centers, radii = stream.uniform(15.0, 85.0, (3, 2)), stream.uniform(4.0, 15.0, 3)
        gaps = np.linalg.norm(centers[:, None] - centers, axis=-1) - radii[:, None] - radii
        if gaps[np.triu_indices(3, 1)].min() > 1.0:
            break
    field = Field(name="three", obstacles=Obstacles.discs(centers, radii))
    expected = lengths_by_trial(field, 4)[:8]
    found = [path.length for path in best_classes(field, field.start, 8)]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_from_a_point_on_the_way() -> None:
    field = get_field("standard/validation:0")
    togo = DistanceToGoal(field)
    point = np.array([45.0, 30.0])
    while togo([point])[0][0] == np.inf:
        point += 1.0
    first, *rest = classes(togo, point, 4)
    assert first.length == pytest.approx(togo([point])[0][0])
    assert len(rest) == 3
    np.testing.assert_array_equal(first.lines[0, 0], point)


@given(field=fields(most=8))
@settings(deadline=None, max_examples=150, derandomize=True)
def test_in_any_field_classes_are_taut_and_in_order(field: Field) -> None:
    paths = best_classes(field, field.start, 4)
    assert_classes(paths, field)
    ways = {tuple(zip(path.discs.tolist(), path.senses.tolist(), strict=True)) for path in paths}
    assert len(ways) == len(paths)
