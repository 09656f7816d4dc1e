"""Tables of circles, and start, goal, bounds and limits where a source has none."""

import numpy as np
import pytest

from ferguson_gym.importers import Placement, read_circles
from ferguson_gym.world.obstacles import Obstacles
from tests.support.places import ROOT


def read(tmp_path, text, **options):
    path = tmp_path / "c.csv"
    path.write_text(text, encoding="utf-8")
    return read_circles(path, **options)


@pytest.mark.parametrize(
    "text",
    [
        "1,2,0.5\n30,40,2\n",
        "x,y,radius\r\n1,2,0.5\r\n30,40,2",
        "\ufeffRadius, kind, Y ,X\n0.5,oak,2,1\n\n \t\n2,fir,40,30\n",
    ],
)
def test_circles_are_read_with_and_without_a_header(text, tmp_path):
    field = read(tmp_path, text)
    assert field.name == "c"
    assert field.obstacles.centers.tolist() == [[1.0, 2.0], [30.0, 40.0]]
    assert field.obstacles.radii.tolist() == [0.5, 2.0]


def test_the_example_is_in_centimetres():
    field = read_circles(ROOT / "examples" / "worlds" / "trees.csv", scale=0.01)
    assert len(field.obstacles) == 40
    assert set(field.obstacles.radii.round(9)) <= {0.8, 1.2, 1.6, 2.2}
    assert field.limits.longest == 15.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "c.csv: no circles; each line needs x, y and radius"),
        ("x,y,radius\n", "c.csv: no circles"),
        ("x,y\n1,2\n", "c.csv, line 1: the header has no radius; circles need columns x, y, rad"),
        ("1,2,3\n1,2\n", "c.csv, line 2: need the numbers x, y and radius, .* got '1,2'"),
        ("1,2,3\n\n1,b,3\n", "c.csv, line 3: need the numbers"),
        ("1,2,0\n", "c.csv, line 1: a radius must be above 0, got 0"),
        ("1,2,nan\n", "c.csv, line 1: a radius must be above 0, got nan"),
        ("1,2,3\n1,inf,2\n", "c.csv, line 2: x, y and radius must be finite, got inf"),
        ("1,1e200,2\n", "c.csv, line 1: x, y and radius must be at most 1e"),
        ("1;2;3\n", "c.csv, line 1: the header has .* x, y, radius, separated by commas"),
    ],
)
def test_bad_tables_are_refused_by_line(text, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, text)


def test_files_that_are_no_text_are_refused(tmp_path):
    (tmp_path / "c.csv").write_bytes(b"\xff\xfe1,2,3")
    with pytest.raises(ValueError, match="not a CSV file"):
        read_circles(tmp_path / "c.csv")


def test_what_is_given_is_kept_and_the_rest_follows_from_the_box():
    obstacles = Obstacles.discs([[0.0, 0.0], [200.0, 100.0]], [1.0, 5.0])
    field = Placement().field("a", obstacles)
    assert field.bounds.tolist() == [[-16.0, -16.0], [220.0, 120.0]]
    assert field.start.tolist() == [-8.5, -8.5]
    assert field.goal.tolist() == [212.5, 112.5]
    assert (field.limits.longest, field.limits.shortest) == (15.0, 3.0)
    bounds = (-50.0, -40.0, 300.0, 200.0)
    field = Placement(start=(50, 60), goal=(60, -5), bounds=bounds, room=3).field("b", obstacles)
    assert field.bounds.tolist() == [[-50.0, -40.0], [300.0, 200.0]]
    # bounds contain a start that was given
    field = Placement(start=(50, -60), limits={"longest": 20.0}).field("c", obstacles)
    assert field.bounds.tolist() == [[-21.0, -60.0], [225.0, 125.0]]
    assert (field.limits.longest, field.limits.shortest) == (20.0, 4.0)


def test_small_fields_have_small_segments():
    small = Obstacles.discs([[0.0, 0.0], [3.0, 4.0]], [0.5, 0.5])
    field = Placement(start=(-1, 0), goal=(4, 0)).field("a", small)
    assert field.limits.longest == pytest.approx(15.0 * 5.0 / (100.0 * 2**0.5))
    assert Placement(limits={"longest": 2.0}).field("b", small).limits.longest == 2.0
    with pytest.raises(ValueError, match=r"lies .* inside obstacle 0"):
        Placement(start=(0, 0), goal=(4, 0)).field("c", small)


def test_placements_that_make_no_sense_are_refused():
    nothing = Obstacles.discs(np.empty((0, 2)), [])
    with pytest.raises(ValueError, match="no obstacles, so start and goal must be given"):
        Placement().field("a", nothing)
    assert Placement(start=(0, 0), goal=(9, 9)).field("a", nothing).distance > 12.0
    for message, options in {
        "start must have shape": {"start": (1.0, 2.0, 3.0)},
        "bounds must be finite": {"bounds": (0.0, 0.0, 1.0, np.inf)},
        "room around obstacles must be above 0 m, got -1 m": {"room": -1.0},
        "unknown limit 'fastest'": {"limits": {"fastest": 1.0}},
    }.items():
        with pytest.raises(ValueError, match=message):
            Placement(**options)
