"""What every path of lines and arcs must be, and random fields of discs to find paths in."""

import numpy as np
import pytest
from hypothesis import strategies as st

from ferguson_gym.shortest_paths import distance_to_goal
from ferguson_gym.shortest_paths.distance_to_goal import DistanceToGoal
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.shortest_paths.taut_path import ShortestPath
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles


def random_field(
    seed: int, discs: int, largest: float = 20.0, start: tuple[float, float] = (0.0, 0.0)
) -> Field:
    """Discs that may overlap each other and the bounds; start and goal are left free."""
    stream = np.random.default_rng(seed)
    centers = stream.uniform(-10.0, 110.0, (discs, 2))
    radii = stream.uniform(0.5, largest, discs)
    every = Obstacles.discs(centers, radii)
    free = (every.signed_distance(np.array([start, (100.0, 100.0)])) > 0.0).all(axis=0)
    return Field(
        name=f"random {seed}", obstacles=Obstacles.discs(centers[free], radii[free]), start=start
    )


# few values, so that discs coincide, touch, contain and align with each other
coordinates = st.integers(-2, 22).map(lambda k: 5.0 * k)
numbers = st.one_of(coordinates, st.floats(-15.0, 115.0, width=32))
sizes = st.one_of(st.integers(1, 8).map(lambda k: 2.5 * k), st.floats(0.125, 30.0, width=32))


@st.composite
def fields(draw: st.DrawFn, most: int = 12) -> Field:
    """Fields of overlapping discs, degenerate more often than not."""
    discs = draw(st.lists(st.tuples(numbers, numbers, sizes), max_size=most))
    ends = np.array([[0.0, 0.0], [100.0, 100.0]])
    every = np.array(discs).reshape(-1, 3)
    apart = np.linalg.norm(every[:, None, :2] - ends, axis=-1)
    free = (apart >= every[:, 2:]).all(axis=1)
    return Field(name="drawn", obstacles=Obstacles.discs(every[free, :2], every[free, 2]))


@st.composite
def walls(draw: st.DrawFn) -> np.ndarray:
    """A wall (n, 3) of overlapping discs (x, y, radius) at x = 0, from below -10 to above 110."""
    radius = draw(st.sampled_from([1.5, 2.0, 3.0]))
    first = -10.0 - draw(st.sampled_from([0.0, 0.25, 1e-4, 0.5]))
    heights = np.arange(first, 111.0, 2.0)
    radii = np.full(len(heights), radius)
    # a few are larger, mostly by so little that common tangents are almost parallel to the bounds
    for k in draw(st.lists(st.integers(0, len(heights) - 1), max_size=4)):
        radii[k] += draw(st.sampled_from([1e-7, 1e-4, 0.25]))
    for end in (0, -1):
        radii[end] += draw(st.sampled_from([0.0, 0.0, 1e-7, 1e-4]))
    return np.stack([np.zeros(len(heights)), heights, radii], axis=1)


def assert_is_taut(path: ShortestPath, field: Field, depth: float = 2e-7) -> None:
    """Pieces join without a corner, enter no disc, stay inside the bounds and add up."""
    discs = field.obstacles
    assert discs.are_discs
    spans = path.lines[:, 1] - path.lines[:, 0]
    long = np.linalg.norm(spans, axis=1)
    np.testing.assert_allclose(long.sum() + path.radii @ path.sweeps, path.length, rtol=1e-9)
    np.testing.assert_array_equal(path.lines[-1, 1], field.goal)
    np.testing.assert_array_equal(path.centers, discs.centers[path.discs])
    np.testing.assert_array_equal(path.radii, discs.radii[path.discs])
    ends = path.centers[:, None] + path.radii[:, None, None] * np.stack(
        [np.cos(path.angles), np.sin(path.angles)], axis=-1
    )
    np.testing.assert_allclose(path.lines[:-1, 1], ends[:, 0], atol=1e-9)
    np.testing.assert_allclose(path.lines[1:, 0], ends[:, 1], atol=1e-9)
    assert (path.senses * (path.angles[:, 1] - path.angles[:, 0]) >= 0.0).all()
    # the way along an arc at its start and at its end is that of the lines there
    way = path.senses[:, None, None] * np.stack(
        [-np.sin(path.angles), np.cos(path.angles)], axis=-1
    )
    for k in range(len(path.discs)):
        for line, along in ((k, way[k, 0]), (k + 1, way[k, 1])):
            cross = along[0] * spans[line, 1] - along[1] * spans[line, 0]
            assert abs(cross) <= 1e-7 * max(long[line], 1.0)
            assert along @ spans[line] >= -1e-7
    points = path.points(0.25)
    assert (points >= field.bounds[0] - depth).all()
    assert (points <= field.bounds[1] + depth).all()
    if len(discs):
        assert discs.signed_distance(points).min() >= -depth
    assert line_depth(path.lines[:, 0], path.lines[:, 1], field).max() <= depth


def line_depth(starts: np.ndarray, ends: np.ndarray, field: Field) -> np.ndarray:
    """How deep lines (n, 2) run in discs or out of the bounds [m], negative where they do not."""
    discs = field.obstacles
    assert discs.are_discs
    span = (ends - starts)[:, None]
    share = ((discs.centers - starts[:, None]) * span).sum(axis=-1)
    share /= np.maximum((span**2).sum(axis=-1), 1e-300)
    nearest = starts[:, None] + np.clip(share, 0.0, 1.0)[..., None] * span
    within = discs.radii - np.linalg.norm(nearest - discs.centers, axis=-1)
    both = np.stack([starts, ends])
    outside = np.maximum(field.bounds[0] - both, both - field.bounds[1]).max(axis=(0, 2))
    return np.maximum(within.max(axis=1, initial=-np.inf), outside)


def field_of(centers: object, radii: object, **options: object) -> Field:
    """A field of discs."""
    return Field(name="of discs", obstacles=Obstacles.discs(centers, radii), **options)  # type: ignore[arg-type]


def found(field: Field) -> ShortestPath:
    """The shortest path, which must exist and be taut."""
    path = shortest_path(field)
    assert path is not None
    assert_is_taut(path, field)
    np.testing.assert_array_equal(path.lines[0, 0], field.start)
    return path


def from_graph(field: Field) -> DistanceToGoal:
    """The distance to the goal from the graph of all tangents, however many they are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distance_to_goal, "FEW", 10**9)
        return DistanceToGoal(field)


def from_search(field: Field) -> DistanceToGoal:
    """The distance to the goal from a search that is kept, however few discs there are."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(distance_to_goal, "FEW", -1)
        return DistanceToGoal(field)
