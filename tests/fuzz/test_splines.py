"""Splines, whatever numbers and arrays come: bounds hold, and nothing is NaN."""

from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from ferguson_gym.curves import splines
from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.clearance import clearance, closest, is_clear, least_speed
from ferguson_gym.curves.path import Path
from ferguson_gym.curves.turning import bending_energy, fastest_turn, tightest_turn
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.turn_radius import keeps_turn_radius, too_sharp_at
from tests.fuzz.cases import attempt, fuzzed
from tests.fuzz.strategies import NO_ARRAYS, WILD, arrays, laid_out, scaled_segments, segments

T = np.linspace(0.0, 1.0, 101)
DIMENSIONS = st.integers(1, 3)
ALL = {
    "evaluate": lambda control: splines.evaluate(control, T),
    "derivative": lambda control: splines.derivative(control, T, 2),
    "curvature": lambda control: splines.curvature(control, T),
    "max_curvature": splines.max_curvature,
    "subdivide": lambda control: np.stack(splines.subdivide(control, 0.3)),
    "extent": lambda control: np.stack(splines.extent(control)),
    "to_bezier": splines.to_bezier,
    "from_bezier": splines.from_bezier,
    "as_control": splines.as_control,
    "length": length,
    "least_speed": lambda control: np.stack(least_speed(control)),
    "bending_energy": bending_energy,
    "too_sharp_at": lambda control: too_sharp_at(control, 3.0),
    "path": lambda control: Path(control).control,
    "clearance": lambda control: clearance(control, [[0.0] * _width(control)], [1.0]),
}
MAY_BE_NAN = {"too_sharp_at"}


def _width(control: Any) -> int:
    return control.shape[-1] if isinstance(control, np.ndarray) and control.ndim else 1


def size_of(control: np.ndarray) -> float:
    return float(np.abs(control).max(initial=0.0))


@pytest.mark.parametrize("name", ALL)
def test_what_is_no_control_array_is_refused_in_one_sentence(name: str) -> None:
    @fuzzed(f"splines: {name}, of anything", few=4, many=400, given_=NO_ARRAYS | arrays_of_any())
    def case(given_: Any) -> None:
        with np.errstate(all="ignore"):
            found = attempt(ALL[name], given_)
        if found is not None and name not in MAY_BE_NAN:
            assert not np.isnan(found).any()

    case()


def arrays_of_any() -> st.SearchStrategy[Any]:
    shapes = [(4, 2), (2, 4, 2), (4, 3), (4, 1), (3, 2), (2, 4), (4,), (1, 1, 4, 2), (5, 2)]
    return st.sampled_from(shapes).flatmap(lambda shape: arrays(*shape)).flatmap(laid_out)


@fuzzed(
    "splines: points, derivatives and Bézier points of any size",
    many=6000,
    control=DIMENSIONS.flatmap(scaled_segments),
    data=st.data(),
)
def test_ends_and_derivatives_are_those_of_the_array(control: np.ndarray, data: Any) -> None:
    given = data.draw(laid_out(control))
    points = attempt(splines.evaluate, given, [0.0, 1.0])
    if points is None:
        assert size_of(control) > 1e120
        return
    slopes = splines.derivative(given, [0.0, 1.0])
    close = {"rtol": 0.0, "atol": 64 * 2.0**-52 * size_of(control) + 1e-320}
    np.testing.assert_allclose(points, control[..., :2, :], **close)
    np.testing.assert_allclose(slopes, control[..., 2:, :], **close)
    again = splines.from_bezier(splines.to_bezier(given))
    np.testing.assert_allclose(again, control, **close)
    left, right = splines.subdivide(given, 0.25)
    np.testing.assert_allclose(left[..., 1, :], splines.evaluate(given, [0.25])[..., 0, :], **close)
    np.testing.assert_array_equal(left[..., 1, :], right[..., 0, :])
    low, high = splines.extent(given)
    inside = splines.evaluate(control, T)
    assert (inside >= low[..., None, :] - close["atol"]).all()
    assert (inside <= high[..., None, :] + close["atol"]).all()


@fuzzed("splines: arc length", many=8000, control=DIMENSIONS.flatmap(scaled_segments))
def test_a_length_lies_between_chord_and_polygon(control: np.ndarray) -> None:
    found = attempt(length, control)
    if found is None:
        assert size_of(control) > 1e120
        return
    scale = size_of(control) or 1.0
    unit = control / scale
    steps = np.diff(splines.to_bezier(unit), axis=-2)
    polygon = np.linalg.norm(steps, axis=-1).sum(axis=-1)
    chords = np.diff(splines.evaluate(unit, T), axis=-2)
    sampled = np.linalg.norm(chords, axis=-1).sum(axis=-1)
    assert np.isfinite(found).all()
    slack = 1e-300 if scale > 1e-280 else np.inf  # denormal numbers have few digits
    assert (found / scale >= sampled * (1.0 - 2e-9) - 1e-13 - slack).all()
    assert (found / scale <= polygon * (1.0 + 2e-9) + 1e-13 + slack).all()


@fuzzed(
    "splines: clearance",
    many=8000,
    data=st.data(),
    dimension=DIMENSIONS,
    power=st.one_of(st.just(0), st.integers(-310, 300)),
    seed=st.integers(0, 2**32 - 1),
    number=st.integers(0, 4),
)
def test_a_certified_clearance_is_below_any_sampled_one(
    data: Any, dimension: int, power: int, seed: int, number: int
) -> None:
    stream = np.random.default_rng(seed)
    with np.errstate(all="ignore"):
        factor = 10.0 ** float(power)
        control = data.draw(segments(dimension)) * factor
        centers = stream.normal(0.0, 20.0, (number, dimension)) * factor
        radii = stream.exponential(5.0, number) * factor
    if number and stream.random() < 0.3:  # a centre on the curve, to the last digit
        centers[0] = control.reshape(-1, 4, dimension)[0, stream.integers(2)]
    if not (radii > 0.0).all():
        return
    found = attempt(clearance, control, centers, radii)
    if found is None:
        assert max(size_of(control), size_of(centers), size_of(radii)) > 1e120
        return
    each, where = closest(control, centers, radii)
    assert not np.isnan(found).any()
    assert ((where >= 0.0) & (where <= 1.0)).all()
    scale = max(size_of(control), size_of(centers), size_of(radii)) or 1.0
    points = splines.evaluate(control / scale, T)
    apart = np.linalg.norm(points[..., None, :] - centers / scale, axis=-1) - radii / scale
    sampled = apart.min(axis=-2)
    if scale < 1e-140:  # squares of less are none
        return
    rounding = 1e-15
    assert (each / scale <= sampled + rounding).all()
    if number:
        np.testing.assert_allclose(found, each.min(axis=-1), rtol=0, atol=1e-9 * scale)
        least = float(np.nanmin(found, initial=0.0))
        sure = is_clear(control, centers, radii, least)
        assert (apart.min(axis=(-1, -2))[sure] >= least / scale - rounding).all()
    else:
        assert np.isposinf(found).all()


@fuzzed("splines: least speed", many=6000, control=DIMENSIONS.flatmap(scaled_segments))
def test_a_certified_speed_is_below_any_sampled_one(control: np.ndarray) -> None:
    found = attempt(least_speed, control)
    if found is None:
        assert size_of(control) > 1e120
        return
    speed, where = found
    scale = size_of(control) or 1.0
    sampled = np.linalg.norm(splines.derivative(control / scale, T), axis=-1).min(axis=-1)
    assert not np.isnan(speed).any()
    assert ((where >= 0.0) & (where <= 1.0)).all()
    rounding = 1e-15 + 1e-150 / scale
    assert (speed / scale <= sampled + rounding).all()


@fuzzed("splines: curvature", many=6000, control=st.integers(2, 3).flatmap(scaled_segments))
def test_the_greatest_curvature_is_above_any_sampled_one(control: np.ndarray) -> None:
    found = attempt(splines.max_curvature, control)
    if found is None:
        assert size_of(control) > 1e120
        return
    assert not np.isnan(found).any()
    assert (found >= 0.0).all()
    scale = size_of(control)
    if not scale > 1e-90:
        return
    sampled = splines.curvature(control, T)
    assert not np.isnan(sampled).any()
    slow = np.linalg.norm(splines.derivative(control, T), axis=-1) < 1e-6 * scale
    sampled = np.where(slow, 0.0, sampled).max(axis=-1)
    assert (found >= sampled * (1.0 - 1e-6) - 1e-9 / scale).all()


@fuzzed(
    "splines: turn radius",
    many=6000,
    control=segments(),
    radius=st.one_of(st.floats(0.0, 50.0), WILD),
)
def test_a_turn_radius_that_is_kept_is_kept_at_samples(control: np.ndarray, radius: float) -> None:
    kept = attempt(keeps_turn_radius, control, radius)
    if kept is None:
        assert not PAPER_LIMITS.tolerance < radius < np.inf
        return
    sampled = 1.0 / np.maximum(splines.curvature(control, T), 1e-300)
    assert (sampled.min(axis=-1)[kept] >= (radius - PAPER_LIMITS.tolerance) * (1 - 1e-9)).all()
    sharp = too_sharp_at(control, radius)
    np.testing.assert_array_equal(np.isnan(sharp), kept)


@fuzzed("splines: bending energy", many=1500, control=st.integers(2, 3).flatmap(segments))
def test_a_bending_energy_is_a_number_from_zero_on(control: np.ndarray) -> None:
    assert (bending_energy(control) >= 0.0).all()


@fuzzed("splines: turns of an aircraft", many=3000, value=WILD, roll=st.floats(0.0, 1.6) | WILD)
def test_turns_of_an_aircraft_invert_each_other(value: float, roll: float) -> None:
    for there, back in ((fastest_turn, tightest_turn), (tightest_turn, fastest_turn)):
        found = attempt(there, value, roll)
        if found is not None and 1e-50 < value < 1e50 and 1e-6 < roll < 1.57:
            assert back(found, roll) == pytest.approx(value, rel=1e-9)


@fuzzed(
    "splines: parameters and orders",
    many=3000,
    t=NO_ARRAYS | st.lists(WILD, max_size=4) | WILD,
    order=st.integers(-3, 9) | st.just(1.5) | st.none() | st.just("1"),
)
def test_parameters_that_are_none_are_refused(t: Any, order: Any) -> None:
    control = np.arange(8.0).reshape(4, 2)
    with np.errstate(all="ignore"):
        points, slopes = (
            attempt(splines.evaluate, control, t),
            attempt(splines.derivative, control, t, order),
        )
        bent = attempt(splines.curvature, control, t)
        parts = attempt(splines.subdivide, control, t)
    for found in (points, slopes, bent):
        if found is not None:
            given = np.asarray(t, float)
            assert np.shape(found)[: given.ndim] == given.shape
            assert not np.isnan(found[np.abs(given) <= 1.0]).any()
    assert parts is None or np.isfinite(parts).all()


@fuzzed(
    "splines: paths",
    many=1500,
    seed=st.integers(0, 2**32 - 1),
    number=st.integers(1, 6),
    dimension=st.integers(1, 3),
    power=st.integers(-300, 90),
)
def test_a_path_that_is_saved_is_loaded_bit_for_bit(
    tmp_path_factory: pytest.TempPathFactory, seed: int, number: int, dimension: int, power: int
) -> None:
    stream = np.random.default_rng(seed)
    knots = stream.normal(size=(number + 1, 2, dimension)) * 10.0**power
    control = np.concatenate(
        [np.stack([knots[:-1, k], knots[1:, k]], axis=1) for k in range(2)], axis=1
    )
    path = Path(control)
    place = FilePath(tmp_path_factory.getbasetemp()) / "path.json"
    path.save(place)
    np.testing.assert_array_equal(Path.load(place).control, control)
    assert path.length >= np.linalg.norm(control[-1, 1] - control[0, 0]) * (1 - 1e-9)
    assert path.min_turn_radius >= 0.0
    assert np.isfinite(path.points(7)).all()
