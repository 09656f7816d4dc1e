"""Fields from any numbers, names, files and directories: a field, or one clear error."""

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from ferguson_gym.curves.path import Path as Flown
from ferguson_gym.curves.splines import derivative, evaluate
from ferguson_gym.shortest_paths.exact import exact_length
from ferguson_gym.world import field_names, suites
from ferguson_gym.world.feasibility import inspect, is_feasible
from ferguson_gym.world.field import Field, from_json, to_json
from ferguson_gym.world.limits import PAPER_LIMITS, Limits
from ferguson_gym.world.obstacles import Obstacles
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import (
    JSON,
    NO_ARRAYS,
    WILD,
    arrays,
    damaged,
    fields,
    laid_out,
    segments,
    twisted,
)

SAMPLE = json.dumps(
    {
        "centers": [[30, 30], [60.5, 70]],
        "radii": [6, 4.5],
        "start": [0, 0],
        "goal": [100, 100],
        "bounds": [-10, 110],
        "start_derivative": [3.5, 3.5],
    }
).encode()
T = np.linspace(0.0, 1.0, 201)


def is_sound(field: Field) -> None:
    """What every field promises."""
    for array in (field.start, field.goal, field.bounds, field.departure):
        assert np.isfinite(array).all()
        assert not array.flags.writeable
    low, high = field.bounds
    for point in (field.start, field.goal):
        assert ((low <= point) & (point <= high)).all()
        if len(field.obstacles):
            assert field.obstacles.signed_distance(point).min() >= 0.0
    assert 0.0 < field.distance < np.inf
    assert np.linalg.norm(field.departure) >= PAPER_LIMITS.slowest * (1 - 1e-12)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fields") / "field.json"


ANYTHING = NO_ARRAYS | JSON | st.tuples(WILD, WILD) | arrays(2, 2) | arrays(3, 2) | arrays(2)


@fuzzed(
    "fields: of anything",
    many=6000,
    centers=ANYTHING,
    radii=ANYTHING,
    options=st.fixed_dictionaries(
        {},
        optional={
            "start": ANYTHING,
            "goal": ANYTHING,
            "bounds": ANYTHING,
            "start_derivative": ANYTHING,
        },
    ),
    sound=st.booleans(),
)
def test_a_field_of_anything_is_sound_or_refused(
    centers: Any, radii: Any, options: dict[str, Any], sound: bool
) -> None:
    with np.errstate(all="ignore"):
        discs = (
            Obstacles.discs([[40.0, 50.0]], [5.0])
            if sound
            else attempt(Obstacles.discs, centers, radii)
        )
        if discs is None:
            return
        field = attempt(Field, name="any", obstacles=discs, **options)
        if field is not None:
            is_sound(field)


@fuzzed("fields: drawn", many=6000, field=fields())
def test_fields_that_are_accepted_are_sound_and_come_back_from_json(
    place: Path, field: Field
) -> None:
    is_sound(field)
    to_json(field, place)
    again = from_json(place)
    for key in ("start", "goal", "bounds", "start_derivative"):
        np.testing.assert_array_equal(getattr(again, key), getattr(field, key))
    assert again.obstacles.are_discs
    assert field.obstacles.are_discs
    np.testing.assert_array_equal(again.obstacles.centers, field.obstacles.centers)


@fuzzed(
    "fields: JSON files",
    many=10000,
    text=damaged(SAMPLE) | twisted(SAMPLE) | JSON.map(lambda value: json.dumps(value).encode()),
)
def test_a_file_holds_a_sound_field_or_is_refused(place: Path, text: bytes) -> None:
    place.write_bytes(text)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", UserWarning)  # of unknown keys
        field = attempt(from_json, place)
        if field is not None:
            is_sound(field)
        by_name = attempt(field_names.get_field, str(place))
    assert (field is None) == (by_name is None)


PATH = json.dumps({"control": [[[0, 0], [9, 9], [9, 9], [9, 9]]]}).encode()


@fuzzed(
    "paths: JSON files",
    many=4000,
    text=damaged(PATH) | twisted(PATH) | JSON.map(lambda value: json.dumps(value).encode()),
)
def test_a_file_holds_a_path_or_is_refused(place: Path, text: bytes) -> None:
    place.write_bytes(text)
    path = attempt(Flown.load, place)
    if path is not None:
        assert np.isfinite(path.length)


WORDS = st.sampled_from(
    [
        *("paper", "standard", "dense", "traps", "/", "/train", "/test", "validation", ":", "-"),
        *("0", "1", "4", "5", "07", "9" * 30, "\x00", " ", ".json", "..", "~", "*", "é", "٣", "\n"),
    ]
)


@fuzzed(
    "fields: names",
    many=10000,
    spec=st.lists(WORDS, max_size=7).map("".join) | st.text(max_size=12) | st.just("x" * 4000),
)
def test_a_name_is_known_or_refused(spec: str) -> None:
    chosen = attempt(field_names.get_fields, spec, errors=(ValueError, OSError))
    first = None if chosen is None else attempt(next, chosen)  # which may be a file of another kind
    if first is not None:
        is_sound(first)
    alone = attempt(field_names.get_field, spec, errors=(ValueError, OSError))
    if alone is not None:
        assert chosen is not None
    drawn = attempt(field_names.family, spec, errors=(ValueError, OSError))
    assert drawn is None or len(drawn[1]) >= 1


FIELDS = ("a.json", "b.json", "d.json")


@fuzzed(
    "fields: directories",
    many=1000,
    names=st.lists(
        st.sampled_from(["a.json", "b.json", "c.txt", ".json", ".hidden.json", "d.json"]),
        unique=True,
    ),
    text=st.just(SAMPLE) | damaged(SAMPLE),
    kind=st.sampled_from(["file", "directory", "broken link", "no permission"]),
)
def test_a_directory_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], text: bytes, kind: str
) -> None:
    directory = tmp_path_factory.mktemp("many")
    for name in names:
        place = directory / name
        if kind == "directory":
            place.mkdir()
        elif kind == "broken link":
            place.symlink_to(directory / "nothing")
        else:
            place.write_bytes(text)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", UserWarning)
        try:
            found = attempt(lambda: list(field_names.get_fields(str(directory))))
        except OSError as error:
            assert error.filename  # noqa: PT017 (which other errors are faults)
            found = None
    assert found is None or [field.name for field in found] == [
        name.removesuffix(".json") for name in sorted(names) if name in FIELDS
    ]
    for one in directory.iterdir():
        one.rmdir() if one.is_dir() and not one.is_symlink() else os.unlink(one)
    directory.rmdir()


@fuzzed(
    "suites: recipes",
    many=4000,
    suite=st.sampled_from([*suites.SUITES, "jungle", "", None]),
    obstacles=st.none() | st.integers(-3, 90),
    radii=st.none() | st.tuples(WILD, WILD) | st.tuples(st.floats(0, 8), st.floats(0, 8)),
    seed=st.integers(-5, 2**64),
    split=st.sampled_from([*suites.SPLITS, "exam", None]),
)
def test_an_altered_suite_draws_sound_fields_or_is_refused(
    suite: Any, obstacles: int | None, radii: Any, seed: int, split: Any
) -> None:
    if attempt(suites.check_suite, suite, split) is None and (
        suite not in suites.SUITES or split not in suites.SPLITS
    ):
        return
    recipe = attempt(suites.with_overrides, suite, obstacles, radii)
    discs = attempt(suites.suite_obstacles, suite, split, seed, recipe)
    if discs is not None:
        is_sound(Field(name="drawn", obstacles=discs))


@fuzzed(
    "limits",
    many=3000,
    values=st.dictionaries(
        st.sampled_from(["shortest", "longest", "slowest", "gate", "tolerance", "segments"]),
        WILD | st.integers(-2, 50) | st.none() | st.just("3") | st.just([1.0]),
    ),
)
def test_limits_are_consistent_or_refused(values: dict[str, Any]) -> None:
    limits = attempt(Limits, **values)
    if limits is not None:
        assert 0 <= limits.gate < limits.shortest < limits.longest < np.inf
        assert limits.for_distance(100.0).numbers().segments >= 1


@fuzzed(
    "feasibility",
    many=8000,
    data=st.data(),
    field=fields(),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_feasible_segment_is_feasible_at_samples(data: Any, field: Field, seed: int) -> None:
    stream = np.random.default_rng(seed)
    control = data.draw(segments()) * 0.3 + stream.uniform(0.0, 100.0, 2) * [[1], [1], [0], [0]]
    if stream.random() < 0.5:  # one that may well be
        step = stream.normal(size=2)
        step *= stream.uniform(3.0, 15.0) / np.linalg.norm(step)
        begin = stream.uniform(0.0, 100.0, 2)
        control = np.stack([begin, begin + step, step, step * stream.uniform(0.8, 1.2)])
    found = inspect(data.draw(laid_out(control)), field)
    feasible = is_feasible(control, field)
    assert not np.isnan(found.slack(PAPER_LIMITS)).any()
    points, slopes = evaluate(control, T), derivative(control, T)
    speed = np.linalg.norm(slopes, axis=-1).min(axis=-1)
    sampled = np.linalg.norm(np.diff(points, axis=-2), axis=-1).sum(axis=-1)
    low, high = field.bounds
    room = np.minimum(points - low, high - points).min(axis=(-2, -1))
    apart = field.obstacles.signed_distance(points).min(axis=(-2, -1), initial=np.inf)
    slack = -PAPER_LIMITS.tolerance - 1e-12
    for ok in (
        speed - PAPER_LIMITS.slowest >= slack,
        PAPER_LIMITS.longest - sampled >= slack,
        room >= slack,
        apart >= slack,
    ):
        assert np.all(ok | ~feasible)
    if control.ndim == 2:
        assert found.outcome(PAPER_LIMITS).value[0] == 0 or not feasible


@fuzzed("planners: exact length", many=6000, field=fields(most=12))
def test_an_exact_length_is_at_least_the_straight_distance(field: Field) -> None:
    exact = exact_length(field)
    if exact is not None:
        size = float(np.ptp(field.bounds))
        assert exact >= field.distance - 1e-6 - 1e-8 * size
        assert np.isfinite(exact)


@fuzzed(
    "obstacles",
    many=4000,
    field=fields(),
    points=arrays(3, 2, numbers=st.floats(-1e6, 1e6)),
    reach=WILD,
)
def test_signed_distances_and_gradients_are_numbers(
    field: Field, points: np.ndarray, reach: float
) -> None:
    obstacles = field.obstacles
    away, gradient = obstacles.signed_distance(points), obstacles.gradient(points)
    assert np.isfinite(away).all()
    assert np.isfinite(gradient).all()
    size = np.linalg.norm(gradient, axis=-1)
    assert (np.isclose(size, 1.0) | (size == 0.0)).all()
    free = obstacles.are_free(points[:, None])
    np.testing.assert_array_equal(free | (away.min(axis=-1, initial=np.inf) < 1e-9), True)
    if not np.isnan(reach):
        assert len(obstacles.near(points[0], reach)) == (away[0] <= reach).sum()
