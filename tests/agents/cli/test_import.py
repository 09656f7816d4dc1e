"""`ferguson import`: files of all formats become fields, all or none of them."""

import json
from pathlib import Path

import numpy as np
import pytest

from agents.cli.main import main
from ferguson_gym.world.field import from_json
from tests.support.places import ROOT

WORLDS = ROOT / "examples" / "worlds"
CIRCLES = "x,y,radius\n0,0,1\n40,60,2\n"


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text(CIRCLES)
    Path("b.csv").write_text(CIRCLES.replace("40", "50"))
    Path("bad.csv").write_text("1,2\n")
    return tmp_path


def run(line, capsys):
    status = main(["import", *line.split()])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_several_sources_become_fields_that_can_be_read(capsys):
    line = f"a.csv b.csv {WORLDS}/arena.map {WORLDS}/posts.world --pairs 1-2 --out fields"
    status, out, err = run(line, capsys)
    assert status == 0
    names = sorted(path.name for path in Path("fields").iterdir())
    assert names == ["a.json", "arena-1.json", "arena-2.json", "b.json", "posts.json"]
    assert "a: 2 obstacles on 55.6 x 75.6 m" in out
    assert "wrote 5 fields to fields" in err
    for name in names:
        from_json(Path("fields") / name)


def test_options_place_and_scale(capsys):
    line = "a.csv --out f --scale 0.5 --start -5 -5 --goal 30 40 --bounds -10 -10 50 60 --quiet"
    assert run(f"{line} --limit longest=10 --limit gate=0.5", capsys) == (
        0,
        "a: 2 obstacles on 60 x 70 m, 57.01 m from start to goal, segments of 2 to 10 m\n",
        "",
    )
    field = from_json("f/a.json")
    assert field.obstacles.centers.tolist() == [[0.0, 0.0], [20.0, 30.0]]
    assert field.start.tolist() == [-5.0, -5.0]
    assert field.bounds.tolist() == [[-10.0, -10.0], [50.0, 60.0]]
    assert (field.limits.longest, field.limits.gate) == (10.0, 0.5)


def test_maps_and_scenarios_of_other_names(capsys):
    Path("x.map").write_bytes((WORLDS / "arena.map").read_bytes())
    scenario = (WORLDS / "arena.map.scen").read_text().replace("arena.map", "x.map")
    Path("other.scen").write_text(scenario)
    line = "x.map --scenario other.scen --pairs 0 --cell 1 --points corners --close-corners --out f"
    assert run(line, capsys)[0] == 0
    np.testing.assert_array_equal(from_json("f/x-0.json").start, [2.0, 22.0])


def test_footprints_need_their_library_or_are_read(capsys):
    pytest.importorskip("shapely")
    assert run(f"{WORLDS}/town.geojson --out f --room 20", capsys)[0] == 0
    assert len(from_json("f/town.json").obstacles) > 20


def test_fields_are_replaced_only_when_asked_for(capsys):
    assert run("a.csv --out f", capsys)[0] == 0
    status, _, err = run("a.csv b.csv --out f", capsys)
    assert (status, "there is a field a.json in f; choose another --out" in err) == (2, True)
    assert not Path("f/b.json").exists()
    assert run("a.csv b.csv --out f --fresh", capsys)[0] == 0
    assert json.loads(Path("f/b.json").read_text())["centers"][1] == [50.0, 60.0]


REFUSED = {
    "a.csv bad.csv --out f": "bad.csv, line 1: need the numbers x, y and radius",
    "a.csv missing.csv --out f": "missing.csv: No such file or directory",
    "a.csv a.csv --out f": "a second field would be named a, that of a.csv",
    "notes.txt --out f": "the format of notes.txt is not known from its name; give --format",
    "a.csv --format sdf --out f": "invalid choice: 'sdf'",
    "a.csv --format gazebo --out f": "a.csv: not XML",
    "a.csv --pairs 0-3 --out f": "--pairs is for movingai, not for csv",
    "a.csv --close-corners --out f": "--close-corners is for movingai, not for csv",
    "a.csv --start 0 --out f": "expected 2 arguments",
    "a.csv --start 0 0 --out f": "start (0, 0) lies 1 m inside obstacle 0",
    "a.csv --scale 0 --out f": "need a positive number of metres, got '0'",
    "a.csv --limit longest=-1 --out f": "a.csv: need 0 < shortest < longest",
    "a.csv --out a.csv": "a.csv is a file, not a directory",
    "x.map y.map --scenario s.scen --out f": "--scenario is for one map",
    f"{WORLDS}/arena.map --start 1 1 --out f": "--start is for geojson and gazebo and csv",
    f"{WORLDS}/arena.map --pairs 3-9 --out f": "has pairs 0 to 3, not 3 to 9",
}


@pytest.mark.parametrize("line", REFUSED)
def test_bad_command_lines_write_nothing_and_say_why_in_one_line(line, capsys):
    status, out, err = run(line, capsys)
    assert (status, out) == (2, "")
    assert REFUSED[line] in err
    assert err.count("\n") == 1
    assert not Path("f").exists()


def test_a_failure_while_writing_leaves_no_field_behind(monkeypatch, capsys):
    from agents.cli import import_fields

    write, written = import_fields.to_json, []

    def fail_at_second(field, path):
        written.append(path)
        if len(written) == 2:
            raise OSError(28, "No space left on device", str(path))
        write(field, path)

    monkeypatch.setattr(import_fields, "to_json", fail_at_second)
    status, _, err = run("a.csv b.csv --out f", capsys)
    assert (status, "No space left on device" in err) == (2, True)
    assert list(Path("f").iterdir()) == []
