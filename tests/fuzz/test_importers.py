"""Damaged maps and worlds of other programs: sound fields, or an error that names the file."""

from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from ferguson_gym.importers import read_circles, read_geojson, read_map, read_world
from ferguson_gym.world.field import Field
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import damaged, twisted
from tests.fuzz.test_fields import is_sound
from tests.support.places import ROOT

WORLDS = ROOT / "examples" / "worlds"
READERS: dict[str, Callable[[Path], Field | Iterable[Field]]] = {
    "trees.csv": read_circles,
    "posts.world": read_world,
    "arena.map": read_map,
    "arena.map.scen": lambda path: read_map(path.with_suffix("")),
}
if find_spec("shapely") is not None:
    READERS["town.geojson"] = read_geojson


def read(file: Path, name: str) -> list[Field]:
    """The fields of a file, by the reader of an example."""
    made = READERS[name](file)
    return [made] if isinstance(made, Field) else list(made)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("worlds")


@pytest.mark.parametrize("name", sorted(READERS))
def test_undamaged_sources_are_fields(name: str) -> None:
    assert read(WORLDS / name, name)


@fuzzed("importers", few=40, many=4000, name=st.sampled_from(sorted(READERS)), data=st.data())
def test_damaged_sources_are_fields_or_refused(place: Path, name: str, data: Any) -> None:
    for file in WORLDS.iterdir():
        (place / file.name).write_bytes(file.read_bytes())
    whole = (WORLDS / name).read_bytes()
    kinds = [damaged(whole), *([twisted(whole)] if name.endswith("json") else [])]
    (place / name).write_bytes(data.draw(st.one_of(kinds)))

    for field in attempt(read, place / name, name) or []:
        is_sound(field)
