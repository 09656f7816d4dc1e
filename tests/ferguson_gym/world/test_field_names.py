"""The grammar of field names."""

import itertools
import json

import numpy as np
import pytest

from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.paper_fields import paper_field
from ferguson_gym.world.suites import SPLITS, SUITES, suite_field

DISC = {"centers": [[50.0, 50.0]], "radii": [3.0]}


def write(path, **data):
    path.write_text(json.dumps(DISC | data))
    return path


@pytest.mark.parametrize(
    ("spec", "names"),
    [
        ("paper:3", ["paper:3"]),
        ("paper:1-4", ["paper:1", "paper:2", "paper:3", "paper:4"]),
        ("standard/train:0", ["standard/train:0"]),
        ("traps/test:9-11", ["traps/test:9", "traps/test:10", "traps/test:11"]),
        ("forest/validation:5-5", ["forest/validation:5"]),
        ("sparse/train:0-1", ["sparse/train:0", "sparse/train:1"]),
    ],
)
def test_ranges_name_their_fields_both_ends_included(spec, names):
    assert [field.name for field in get_fields(spec)] == names


@pytest.mark.parametrize(("suite", "split"), list(itertools.product(SUITES, SPLITS)))
def test_every_suite_and_split_can_be_named(suite, split):
    named, drawn = get_field(f"{suite}/{split}:17"), suite_field(suite, split, 17)
    np.testing.assert_array_equal(named.obstacles.points, drawn.obstacles.points)
    np.testing.assert_array_equal(named.obstacles.radii, drawn.obstacles.radii)


def test_the_papers_fields_can_be_named():
    named, drawn = get_field("paper:4"), paper_field(4)
    np.testing.assert_array_equal(named.obstacles.centers, drawn.obstacles.centers)


def test_a_huge_range_is_drawn_one_field_at_a_time():
    fields = get_fields("standard/train:0-9000000000000000000")
    assert [field.name for field in itertools.islice(fields, 2)] == [
        "standard/train:0",
        "standard/train:1",
    ]


@pytest.mark.parametrize("name", ["canyon.json", "canyon.field", "paper:1"])
def test_a_file_is_a_field_named_by_its_stem(tmp_path, name, monkeypatch):
    write(tmp_path / name, goal=[90.0, 80.0])
    monkeypatch.chdir(tmp_path)  # a file goes before a field of the same name
    for spec in (str(tmp_path / name), name):
        field = get_field(spec)
        assert field.name == name.partition(".")[0]
        assert field.goal.tolist() == [90.0, 80.0]


def test_a_directory_names_its_json_files_in_order(tmp_path):
    for name in ("b.json", "a.json", "c.json"):
        write(tmp_path / name)
    (tmp_path / "notes.txt").write_text("not a field")
    assert [field.name for field in get_fields(str(tmp_path))] == ["a", "b", "c"]


def test_a_broken_file_in_a_directory_is_named(tmp_path):
    write(tmp_path / "good.json")
    write(tmp_path / "worse.json", radii=[-3.0])
    fields = get_fields(str(tmp_path))
    assert next(fields).name == "good"
    with pytest.raises(ValueError, match=r"worse\.json: radii must be positive, got -3 m"):
        next(fields)


def test_an_empty_directory_is_refused(tmp_path):
    with pytest.raises(ValueError, match=f"no JSON files in directory '{tmp_path}'"):
        get_fields(str(tmp_path))


def test_files_one_level_deeper_are_pointed_out(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "one.json").write_text("{}")
    with pytest.raises(ValueError, match=f"one level deeper, in {tmp_path}/inner$"):
        get_fields(str(tmp_path))


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("paper:0", "fields 1 to 4, not 0"),
        ("paper:3-5", "fields 1 to 4, not 5"),
        ("standard/train:5-4", "empty range in 'standard/train:5-4': 5 is above 4"),
        ("standard/train:9223372036854775808", "got 9223372036854775808"),
        ("standard/train:0-9223372036854775808", "got 9223372036854775808"),
        ("jungle/train:0", "unknown suite 'jungle'"),
        ("standard/exam:0", "unknown split 'exam'"),
        ("standard/train/more:0", "unknown split 'train/more'"),
        ("standard:0", "unknown field 'standard:0': fields are named paper:1 to paper:4"),
        ("standard/train", "unknown field 'standard/train'"),
        ("standard/train:", "unknown field 'standard/train:'"),
        ("standard/train:-3", "unknown field 'standard/train:-3'"),
        ("standard/train:1-", "unknown field 'standard/train:1-'"),
        ("standard/train:1.5", "unknown field 'standard/train:1.5'"),
        ("standard/train:1-2-3", "unknown field 'standard/train:1-2-3'"),
        ("standard/train:٣", "unknown field 'standard/train:٣'"),
        ("paper", "unknown field 'paper'"),
        ("nowhere.json", "no such field file: 'nowhere.json'"),
    ],
)
def test_what_is_wrong_is_named_before_the_first_field(spec, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=message):
        get_fields(spec)


@pytest.mark.parametrize("spec", ["paper:1-2", "standard/train:0-99"])
def test_more_than_one_field_is_not_one(spec):
    with pytest.raises(ValueError, match=f"'{spec}' names more than one field"):
        get_field(spec)


@pytest.mark.parametrize("spec", ["", "x" * 300, "x" * 5000])
def test_names_that_no_file_can_have_are_unknown_fields(spec):
    with pytest.raises(ValueError, match="fields are named"):
        get_fields(spec)


def test_hidden_files_of_a_directory_are_left_alone(tmp_path):
    write(tmp_path / "seen.json")
    write(tmp_path / ".seen.json.swp.json")
    (tmp_path / ".writing-x.json").write_text('{"centers": [[5')
    assert [field.name for field in get_fields(str(tmp_path))] == ["seen"]


def test_a_name_that_is_long_is_shown_in_part():
    with pytest.raises(ValueError, match=r"unknown field 'xxx.*\.\.\.: fields are named"):
        get_fields("x" * 5000)
    with pytest.raises(ValueError, match="unknown field") as refused:
        get_fields("x" * 5000)
    assert len(str(refused.value)) < 400
