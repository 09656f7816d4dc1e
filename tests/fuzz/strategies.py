"""What the fuzz run is made of: numbers, arrays, segments, fields, states, damaged bytes."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy
from numpy.typing import NDArray

from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State

SPECIAL = (
    *(0.0, -0.0, 5e-324, -1e-310, 1e-160, 1e-100, 1e-9, 1.0, -1.0, 1e9, 1e100, -1e154),
    *(1e155, 1e200, 1.7e308, -1.7e308, float("nan"), float("inf"), float("-inf")),
)
TAME = st.floats(-200.0, 200.0)
"""Metres that occur."""
WILD = st.one_of(TAME, st.sampled_from(SPECIAL), st.floats())
"""Any number."""
SEEDS = st.integers(0, 2**32 - 1)

NO_ARRAYS: SearchStrategy[Any] = st.sampled_from(
    [
        *(None, "fly", b"\x00", 1j, True, 7, object(), {}, {"a": 1}, [], [[]], [[1.0], [1.0, 2.0]]),
        *(np.zeros(()), np.zeros(0), np.zeros((0, 2)), np.zeros((0, 4, 2)), np.zeros((4, 0))),
        *(np.zeros((4, 2), complex), np.zeros((4, 2), object), np.full((4, 2), "1"), 10**400),
        *(np.zeros((4, 2), "M8[s]"), np.zeros(3, [("x", float)]), range(4), [None] * 4),
    ]
)
"""What is no array of numbers, or one of a shape that nobody wants."""


@st.composite
def arrays(draw: DrawFn, *shape: int, numbers: SearchStrategy[float] = WILD) -> NDArray[Any]:
    """An array of numbers of a shape: of few different ones, or all drawn."""
    size = int(np.prod(shape))
    if draw(st.booleans()):
        few = draw(st.lists(numbers, min_size=1, max_size=3))
        chosen = np.random.default_rng(draw(SEEDS)).integers(len(few), size=size)
        return np.array(few)[chosen].reshape(shape)
    return np.array(draw(st.lists(numbers, min_size=size, max_size=size)), float).reshape(shape)


@st.composite
def segments(draw: DrawFn, dimension: int = 2) -> NDArray[np.float64]:
    """Control arrays (..., 4, D) of the usual size, among them degenerate ones."""
    stream = np.random.default_rng(draw(SEEDS))
    batch = draw(st.sampled_from([(), (1,), (3,), (2, 2)]))
    control = stream.normal(0.0, 20.0, (*batch, 4, dimension))
    kind = draw(st.sampled_from(["any", "straight", "point", "cusp", "still", "closed", "grid"]))
    if kind == "straight":
        control[..., 1:, :] = stream.normal(size=(*batch, 3, 1)) * control[..., :1, :]
    if kind == "point":
        control[..., 1:, :] = control[..., :1, :] * [[1.0], [0.0], [0.0]]
    if kind == "cusp":  # the derivative vanishes at t = 1/2
        ends = control[..., 3, :] + control[..., 2, :]
        control[..., 1, :] = control[..., 0, :] + ends / 6.0
    if kind == "still":
        control[..., 2:, :] = 0.0
    if kind == "closed":
        control[..., 1, :] = control[..., 0, :]
        control[..., 3, :] = -control[..., 2, :]
    if kind == "grid":
        control = np.round(control / 10.0) * 10.0
    return control


@st.composite
def scaled_segments(draw: DrawFn, dimension: int = 2) -> NDArray[np.float64]:
    """As `segments`, of any size that numbers have."""
    power = draw(st.one_of(st.integers(-3, 3), st.integers(-320, 305)))
    with np.errstate(all="ignore"):
        return draw(segments(dimension)) * 10.0 ** float(power)


@st.composite
def laid_out(draw: DrawFn, array: NDArray[Any]) -> Any:
    """The same numbers as lists, or laid out in memory in another way."""
    kind = draw(st.integers(0, 6))
    if kind == 0:
        return array.tolist()
    if kind == 1:
        return np.asfortranarray(array)
    if kind == 2:
        return np.repeat(array, 2, axis=-1)[..., ::2]
    if kind == 3:
        return array.astype(">f8")
    if kind == 4:
        array = array.copy()
        array.flags.writeable = False
    if kind == 5:
        return array[..., ::-1].copy()[..., ::-1]
    return array


CENTERS = st.one_of(st.floats(-15.0, 115.0), st.sampled_from([0.0, 50.0, 100.0, 1e6, -1e6, 1e-9]))
RADII = st.one_of(
    st.floats(0.1, 20.0), st.floats(1e-9, 1e6), st.sampled_from([1e-9, 1e-6, 1e-3, 3.0, 1e6])
)


@st.composite
def discs(draw: DrawFn, most: int = 8) -> tuple[list[list[float]], list[float]]:
    """Centres and radii of discs: overlapping, nested, touching, tiny, huge."""
    number = draw(st.integers(0, most))
    centers = [[draw(CENTERS), draw(CENTERS)] for _ in range(number)]
    radii = [draw(RADII) for _ in range(number)]
    if number > 1 and draw(st.booleans()):  # one more that touches, is the same, or lies within
        (x, y), r = centers[0], radii[0]
        other = draw(st.sampled_from([r, r / 2.0, 1e-9]))
        apart = draw(st.sampled_from([r + other, 0.0, r - other, r + other - 1e-9]))
        centers[1], radii[1] = [x + apart, y], other
    return centers, radii


POINTS = st.one_of(st.floats(-12.0, 112.0), st.sampled_from([0.0, -10.0, 110.0, 100.0, 50.0]))


@st.composite
def fields(draw: DrawFn, most: int = 8) -> Field:
    """Small fields, often tight: discs that touch the start or the goal, bounds just around."""
    near = draw(st.sampled_from([1e-7, 1e-3, 1.0, 3.0, 14.0, 100.0, 100.0, 100.0]))
    start = np.array([draw(POINTS), draw(POINTS)] if draw(st.booleans()) else [0.0, 0.0])
    goal = np.array([100.0, 100.0])
    if draw(st.booleans()):
        goal = np.array([draw(POINTS), draw(POINTS)])
    elif near < 100.0:
        goal = start + np.array([near, 0.0])
    least, greatest = np.minimum(start, goal), np.maximum(start, goal)
    wide = draw(st.sampled_from([1e-9, 1e-3, 1.0, 5.0, 10.0, 10.0, 15.0, 1e6]))
    centers, radii = draw(discs(most))
    touch = draw(st.sampled_from([1.0 - 1e-12, 0.999, 0.9, 0.5]))
    kept = []
    for center, radius in zip(np.array(centers).reshape(-1, 2), radii, strict=True):
        free = min(np.linalg.norm(center - start), np.linalg.norm(center - goal))
        kept.append((center, min(radius, touch * float(free))))
    kept = [(center, radius) for center, radius in kept if radius > 0.0]
    options: dict[str, Any] = {}
    if draw(st.booleans()):
        options["start_derivative"] = draw(slopes(1.0 + 1e-9, 65.8))
    assume(np.linalg.norm(goal - start) > 0.0)
    return Field(
        name="drawn",
        obstacles=Obstacles.discs(
            np.array([center for center, _ in kept]).reshape(-1, 2),
            np.array([radius for _, radius in kept]),
        ),
        start=start,
        goal=goal,
        bounds=np.array([least - wide, greatest + wide]),
        **options,
    )


@st.composite
def slopes(draw: DrawFn, least: float, most: float = 66.0) -> NDArray[np.float64]:
    """Derivatives of a norm within these bounds."""
    angle, speed = draw(st.floats(-4.0, 4.0)), draw(st.floats(least, most))
    return speed * np.array([np.cos(angle), np.sin(angle)])


@st.composite
def vehicles(draw: DrawFn, field: Field) -> State:
    """States in a field: at its start, anywhere in its bounds, on its goal, inside discs."""
    position, derivative = field.start, field.departure
    usual = [*(["start"] * 4), *(["any"] * 3)]
    kind = draw(st.sampled_from([*usual, "goal", "disc", "edge", "near goal"]))
    low, high = field.bounds
    share = np.array([draw(st.floats(0.0, 1.0)), draw(st.floats(0.0, 1.0))])
    if kind == "any":
        position = low + share * (high - low)
    if kind == "goal":
        position = field.goal
    if kind == "near goal":
        position = field.goal + (share - 0.5) * draw(st.sampled_from([1e-9, 1.0, 8.0]))
    if kind == "edge":
        position = np.where(share < 0.5, low, low + share * (high - low))
    if kind == "disc" and len(field.obstacles):
        assert field.obstacles.are_discs
        position = field.obstacles.centers[0] + (share - 0.5) * field.obstacles.radii[0]
    if draw(st.booleans()):
        derivative = draw(slopes(0.0))
    flown = draw(st.sampled_from([*([0] * 9), 1, 38, 39, 40, 41]))
    return State(np.array(position), np.array(derivative), flown)


ACTIONS = arrays(4, numbers=st.one_of(st.floats(-1.0, 1.0), st.sampled_from([-1.0, 0.0, 1.0])))
"""Actions in the box, double precision."""


@st.composite
def damaged(draw: DrawFn, data: bytes) -> bytes:
    """Bytes cut short, with bytes changed, doubled or put in between, or other bytes."""
    stream = np.random.default_rng(draw(SEEDS))
    kind = draw(st.integers(0, 6))
    if kind == 0:
        return data[: draw(st.integers(0, len(data)))]
    if kind == 1:
        return draw(st.binary(max_size=64))
    found = bytearray(data)
    for _ in range(draw(st.integers(1, 8))):
        if not found:
            break
        place = int(stream.integers(len(found)))
        if kind == 2:
            found[place] ^= 1 << int(stream.integers(8))
        elif kind == 3:
            found[place] = int(stream.integers(256))
        elif kind == 4:
            found[place:place] = stream.bytes(int(stream.integers(1, 9)))
        elif kind == 5:
            del found[place : place + int(stream.integers(1, 40))]
        else:
            other = int(stream.integers(len(found)))
            found[place : place + 20] = found[other : other + 20]
    return bytes(found)


JSON: SearchStrategy[Any] = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=6), inner, max_size=4)
    ),
    max_leaves=12,
)
"""Any value that JSON has, NaN and infinities among them."""


@st.composite
def twisted(draw: DrawFn, data: bytes) -> bytes:
    """JSON in which some values were replaced, removed or moved."""
    found = json.loads(data)
    for _ in range(draw(st.integers(1, 3))):
        holder: Any = found
        for _ in range(draw(st.integers(0, 4))):
            inner = [
                one
                for one in (holder.values() if isinstance(holder, dict) else holder)
                if isinstance(one, dict | list) and one
            ]
            if not inner:
                break
            holder = draw(st.sampled_from(inner))
        if not holder:
            return draw(JSON.map(json.dumps)).encode()
        keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        key = draw(st.sampled_from(keys))
        what = draw(st.integers(0, 3))
        if what == 0:
            del holder[key]
        elif what == 1:
            holder[key] = holder[draw(st.sampled_from(keys))]
        else:
            holder[key] = draw(JSON)
    try:
        return json.dumps(found).encode()
    except (ValueError, RecursionError):  # a value within itself
        return b"[]"
