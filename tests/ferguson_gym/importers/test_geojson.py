"""Building footprints in GeoJSON: what is read, where it lies, and what is refused."""

import json
import warnings

import numpy as np
import pytest

from ferguson_gym.importers import Placement, read_geojson
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.touching import touching_pairs
from tests.support.places import ROOT

shapely = pytest.importorskip("shapely")
from ferguson_gym.importers.geojson import EARTH, footprints  # noqa: E402

DEGREE = np.radians(1.0) * EARTH
SQUARE = [[10.0, 50.0], [10.001, 50.0], [10.001, 50.001], [10.0, 50.001], [10.0, 50.0]]
BESIDE = [[10.001, 50.0], [10.002, 50.0], [10.002, 50.001], [10.001, 50.001], [10.001, 50.0]]


def polygon(*rings):
    return {"type": "Polygon", "coordinates": list(rings)}


def write(path, data):
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    return path


def test_the_example_is_the_area_of_its_footprints():
    path = ROOT / "examples" / "worlds" / "town.geojson"
    field = read_geojson(path)
    every = shapely.union_all(footprints(json.loads(path.read_text())))
    pieces = [shapely.Polygon(field.obstacles.core(k)) for k in range(len(field.obstacles))]
    assert shapely.union_all(pieces).symmetric_difference(every).area < 1e-6 * every.area
    assert field.name == "town"
    # a tenth of the longer side is around the buildings, half of that at start and goal
    low, high = field.obstacles.points.min(axis=0), field.obstacles.points.max(axis=0)
    room = 0.1 * (high - low).max()
    np.testing.assert_allclose(field.bounds, [low - room, high + room], atol=1e-9)
    np.testing.assert_allclose(field.start, low - room / 2.0, atol=1e-9)
    np.testing.assert_allclose(field.goal, high + room / 2.0, atol=1e-9)
    assert field.limits.longest == 15.0
    # the inner yard of the court is free
    assert (field.obstacles.signed_distance(np.array([-48.0, 6.0])) > 5.0).all()


def test_degrees_become_metres_about_the_middle(tmp_path):
    path = write(tmp_path / "square.geojson", polygon(SQUARE))
    field = read_geojson(path, Placement(start=(-90.0, 0.0), goal=(90.0, 0.0), room=50.0))
    wide = 0.0005 * DEGREE * np.cos(np.radians(50.0005))
    deep = 0.0005 * DEGREE
    np.testing.assert_allclose(field.obstacles.points.min(axis=0), [-wide, -deep], rtol=1e-9)
    np.testing.assert_allclose(field.obstacles.points.max(axis=0), [wide, deep], rtol=1e-9)
    assert field.start.tolist() == [-90.0, 0.0]


def test_houses_that_share_a_wall_leave_no_way_between_them(tmp_path):
    multi = {"type": "MultiPolygon", "coordinates": [[SQUARE], [BESIDE]]}
    features = [{"type": "Feature", "geometry": one} for one in (polygon(SQUARE), polygon(BESIDE))]
    for data in (
        multi,
        {"type": "FeatureCollection", "features": features},
        {"type": "GeometryCollection", "geometries": [multi, {"type": "Point"}]},
    ):
        obstacles = read_geojson(write(tmp_path / "two.geojson", data)).obstacles
        assert isinstance(obstacles, Obstacles)
        assert len(obstacles) == 1


def test_walls_of_different_lengths_that_touch_leave_no_way_either(tmp_path):
    """Corners on a neighbour's wall lie beside it by rounding, which may be a gap."""
    turn = np.array([[0.83, 0.55], [-0.57, 0.81]])
    houses = []
    for low, high in ([0, 0], [1, 3]), ([1, 0.7], [2, 2.1]), ([2, -0.3], [3, 2.9]):
        corners = np.array([low, [high[0], low[1]], high, [low[0], high[1]], low], dtype=float)
        houses.append((1e-4 * corners @ turn + [13.4, 52.5]).round(9).tolist())
    data = {"type": "GeometryCollection", "geometries": [polygon(ring) for ring in houses]}
    field = read_geojson(write(tmp_path / "row.geojson", data))
    assert touching_pairs(field).tolist() == []
    # both long sides of the house between the others are their walls
    between = shapely.get_coordinates(footprints(data)[1])
    for begin, end in (between[[1, 2]], between[[3, 0]]):
        wall = begin + np.linspace(0.01, 0.99, 50)[:, None] * (end - begin)
        assert (field.obstacles.signed_distance(wall).min(axis=1) < -1e-4).all()


def test_corners_that_are_straight_but_for_rounding_give_no_warning(tmp_path):
    hook = """0.0007166309353958738 8.042933773393759e-05, 0.0006999622478875019
        -3.955420788275083e-06, 0.000533707291163523 2.8885248177085845e-05, 0.0005371572784010292
        4.6350710877461295e-05, 0.0006859467724246327 1.6960029149606665e-05, 0.0006991654726954983
        8.387932497144388e-05, 0.0007166309353958738 8.042933773393759e-05"""
    court = """0.0008114531241190076 -2.504634900080232e-05, 0.0007142506640733372
        7.308018855244995e-05, 0.0008285359436211886 0.00018628922044180684, 0.000925738403666859
        8.816268288855454e-05, 0.0008114531241190076 -2.504634900080232e-05"""
    yard = """0.0008284577428938321 0.00016975936276133723, 0.0007307805217538067
        7.300198782509345e-05, 0.0008115313248463641 -8.516491320332754e-06, 0.0009092085459863895
        8.824088361591105e-05, 0.0008284577428938321 0.00016975936276133723"""
    crossing = shapely.from_wkt(f"MULTIPOLYGON ((({hook})), (({court}), ({yard})))")
    path = write(tmp_path / "c.geojson", json.loads(shapely.to_geojson(crossing)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_geojson(path)


def test_a_byte_order_mark_is_skipped(tmp_path):
    path = tmp_path / "marked.geojson"
    path.write_text(json.dumps(polygon(SQUARE)), encoding="utf-8-sig")
    assert len(read_geojson(path).obstacles) == 1


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("{", r"bad.geojson: not JSON: "),
        ("[" * 100_000, "bad.geojson: lists and objects are nested too deeply"),
        ("[1]", "the file is not a GeoJSON object with a type, got "),
        ({"type": "FeatureCollection"}, "features must be a list, got None"),
        ({"type": "FeatureCollection", "features": [7]}, "feature 0 is not a GeoJSON object"),
        ({"type": "Point", "coordinates": [1, 2]}, "no Polygon or MultiPolygon"),
        (polygon(SQUARE[:-1]), "ring 0 is open: a ring has four positions or more, and the last"),
        (polygon(SQUARE, SQUARE[:3]), "ring 1 is open"),
        (polygon([[1], [2], [3], [1]]), r"must be a list of positions \[longitude, latitude\]"),
        (polygon([["a", 1]] * 4), "must be a list of positions"),
        (polygon(7), "ring 0 must be a list of positions|coordinates"),
        (polygon([[0, 0], [0.01, 0.01], [0.01, 0], [0, 0.01], [0, 0]]),
         r"self-intersection near longitude 0\.005000, latitude 0\.005000; shapely.make_valid"),
        (polygon([[3e5, 1], [3e5, 2], [4e5, 2], [3e5, 1]]), r"and latitude .* \(300000, "),
        (polygon([[1, 1], [1, 3], [3, 3], [1, 1]]), "spread over 222 km.* up to 100 km"),
        ('{"type": "Polygon", "coordinates": [[[NaN, 1], [2, 1], [2, 2], [NaN, 1]]]}', "finite"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_by_name(data, message, tmp_path):
    path = write(tmp_path / "bad.geojson", data)
    with pytest.raises(ValueError, match=message) as refused:
        read_geojson(path)
    assert str(refused.value).startswith(str(path))


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "shapely", None)
    with pytest.raises(ValueError, match=r"shapely 2.1 or later: .*\[maps\]"):
        read_geojson("town.geojson")
