"""MovingAI maps and scenarios: fields of pairs, and maps that do not match."""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from ferguson_gym.importers import read_map
from ferguson_gym.importers.movingai import read_cells
from ferguson_gym.shortest_paths import exact_length
from tests.support.places import ROOT

ARENA = ROOT / "examples" / "worlds" / "arena.map"
MAP = "type octile\nheight 3\nwidth 4\nmap\n..@.\n.TW.\nG..S\n"
SCENARIO = "version 1\n0\tm.map\t4\t3\t0\t0\t3\t2\t4\n1\tmaps/m.map\t4\t3\t1\t0\t0\t2\t3\n"


@pytest.fixture
def place(tmp_path):
    (tmp_path / "m.map").write_text(MAP)
    (tmp_path / "m.map.scen").write_text(SCENARIO)
    return tmp_path


def test_the_example_has_a_field_for_each_pair():
    fields = list(read_map(ARENA, cell=2.0, limits={"longest": 10.0}))
    assert [field.name for field in fields] == [f"arena-{k}" for k in range(4)]
    blocked = read_cells(ARENA)
    rows, columns = np.mgrid[:24, :32]
    centers = 2.0 * np.stack([columns + 0.5, 24 - rows - 0.5], axis=-1)
    for field in fields:
        inside = (field.obstacles.signed_distance(centers) < 0.0).any(axis=-1)
        np.testing.assert_array_equal(inside, blocked)
        assert field.bounds.tolist() == [[0.0, 0.0], [64.0, 48.0]]
        assert field.limits.shortest == 2.0
    assert fields[0].start.tolist() == [5.0, 43.0]
    assert fields[0].goal.tolist() == [59.0, 5.0]


def test_pairs_points_and_cells_are_as_asked_for(place):
    (field,) = read_map(place / "m.map", pairs=range(1, 2), points="corners", cell=5.0)
    assert field.name == "m-1"
    assert field.start.tolist() == [5.0, 15.0]
    assert field.goal.tolist() == [0.0, 5.0]
    (other,) = read_map(place / "m.map", place / "m.map.scen", range(1))
    assert other.start.tolist() == [1.5, 7.5]
    assert other.goal.tolist() == [10.5, 1.5]
    np.testing.assert_array_equal(
        read_cells(place / "m.map"),
        np.array([[0, 0, 1, 0], [0, 1, 1, 0], [0, 0, 0, 0]], bool),
    )


def test_gaps_of_no_width_between_cells_are_closed_when_asked_for(tmp_path):
    path = tmp_path / "wall.map"
    path.write_text("type octile\nheight 4\nwidth 4\nmap\n...@\n..@.\n.@..\n@...\n")
    Path(f"{path}.scen").write_text("version 1\n0\twall.map\t4\t4\t0\t0\t3\t3\t9\n")
    (field,) = read_map(path, cell=2.0)
    assert exact_length(field) == pytest.approx(2.0 * 18.0**0.5)
    (closed,) = read_map(path, cell=2.0, close_corners=True)
    assert len(closed.obstacles) == len(field.obstacles) + 3
    assert exact_length(closed) is None
    (blocked,) = read_map(ARENA, pairs=range(1), close_corners=True)
    assert len(blocked.obstacles) == len(next(read_map(ARENA)).obstacles)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("type octile\n", "", "m.map: not a MovingAI map, which begins with the lines"),
        ("octile", "octile-corner", "type in line 1 must be octile, .*, got 'octile-corner'"),
        ("octile", "", "type in line 1 must be octile, .*, got ''"),
        ("height 3", "height x", "height and width in lines 2 and 3 must be numbers"),
        ("width 4", "width 99999999999", "of at most 67108864 cells"),
        ("height 3", "height 4", "m.map: 3 rows follow, and the height in line 2 is 4"),
        ("G..S", "G..", "m.map, line 7: 3 cells, and the width in line 3 is 4"),
        ("G..S", "G.xS", "m.map, line 7: unknown cell 'x'; cells are ., G, S, @, O, T, W"),
        ("G..S", "G.äS", "m.map: not a text file"),
    ],
)
def test_maps_of_another_format_are_refused(old, new, message, place):
    (place / "m.map").write_text(MAP.replace(old, new), encoding="utf-8")
    with pytest.raises(ValueError, match=message):
        list(read_map(place / "m.map"))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("version 1", "hello", "m.map.scen: not a MovingAI scenario, which begins with version 1"),
        ("0\tm.map", "0\tn.map", "line 2: the pair is of map 'n.map', not m.map"),
        ("4\t3\t0", "5\t3\t0", "line 2: the pair is of a map of 5 x 3 cells, and m.map has 4 x 3"),
        ("0\t0\t3\t2", "2\t0\t3\t2", r"line 2: start \(2, 0\) is a blocked cell of m.map"),
        ("0\t0\t3\t2", "0\t0\t1\t1", r"line 2: goal \(1, 1\) is a blocked cell of m.map"),
        ("0\t0\t3\t2", "0\t0\t4\t2", r"line 2: goal \(4, 2\) lies outside m.map"),
        ("0\t0\t3\t2", "0\t0\t0\t0", "pair 0: start and goal coincide"),
        ("0\t0\t3\t2", "0\t0\t3", "line 2: a pair has bucket, map, width, height, start x and y"),
        ("0\t0\t3\t2", "0\t0\tx\t2", "line 2: a pair has bucket"),
    ],
)
def test_scenarios_that_do_not_match_are_refused(old, new, message, place):
    (place / "m.map.scen").write_text(SCENARIO.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        list(read_map(place / "m.map"))


@pytest.mark.parametrize("behind", ["", "\n", "\n\n \n"])
def test_a_scenario_without_pairs_is_refused(behind, place):
    (place / "m.map.scen").write_text(f"version 1{behind}")
    with pytest.raises(ValueError, match=r"m\.map\.scen has no pairs of start and goal"):
        list(read_map(place / "m.map"))


def test_options_that_make_no_sense_are_refused(place):
    for message, options in {
        "has pairs 0 to 1, not 1 to 2": {"pairs": range(1, 3)},
        "no scenario .*x.scen for .*m.map; name another": {"scenario": place / "x.scen"},
        "points are centers or corners of cells, got 'sides'": {"points": "sides"},
        "a cell's side must be above 0 m, got 0 m": {"cell": 0.0},
        "unknown limit 'fastest'": {"limits": {"fastest": 1.0}},
    }.items():
        with pytest.raises(ValueError, match=message):
            list(read_map(place / "m.map", **options))


def test_shortest_paths_are_those_around_the_united_cells():
    """A visibility graph on the outline of all blocked cells, without any rectangles."""
    shapely = pytest.importorskip("shapely")
    rows, columns = np.nonzero(read_cells(ARENA))
    cells = shapely.box(columns, 24 - rows - 1, columns + 1, 24 - rows)
    solid = shapely.buffer(shapely.union_all(cells), -1e-9, join_style="mitre")
    shapely.prepare(solid)
    outline = np.unique(shapely.get_coordinates(shapely.union_all(cells)).round(6), axis=0)
    fields = list(read_map(ARENA, cell=1.0))
    points = np.concatenate([outline, *([field.start, field.goal] for field in fields)])
    first, second = np.triu_indices(len(points), 1)
    lines = shapely.linestrings(np.stack([points[first], points[second]], axis=1))
    free = ~shapely.intersects(solid, lines)
    lengths = np.linalg.norm(points[first] - points[second], axis=1)[free]
    graph = csr_array((lengths, (first[free], second[free])), shape=(len(points),) * 2)
    starts = len(outline) + 2 * np.arange(len(fields))
    found = dijkstra(graph, directed=False, indices=starts)[np.arange(len(fields)), starts + 1]
    np.testing.assert_allclose([exact_length(field) for field in fields], found, rtol=1e-12)
