"""Weights in a zip: read back as written; hostile and damaged files are refused."""

import io
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.lib import format as npy

from agents.models import weights
from agents.models.weights import MAX_WEIGHTS, entry

SHAPES = {"first.weight": (5, 3), "first.bias": (5,), "spread": ()}


@pytest.fixture
def packed(tmp_path: Path) -> Path:
    path = tmp_path / "model.zip"
    stream = np.random.default_rng(0)
    given = {name: stream.normal(size=shape).astype(np.float32) for name, shape in SHAPES.items()}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("policy.pth", b"whatever")
        weights.write(archive, given)
    return path


def replace(path: Path, name: str, content: bytes) -> None:
    """Replace an entry of a zip."""
    with zipfile.ZipFile(path) as archive:
        kept = {entry: archive.read(entry) for entry in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for other, value in {**kept, name: content}.items():
            archive.writestr(other, value, zipfile.ZIP_DEFLATED)


def saved(array: object, **options: bool) -> bytes:
    file = io.BytesIO()
    np.save(file, array, **options)  # type: ignore[arg-type, call-overload]
    return file.getvalue()


def refusal(path: Path, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        weights.read(path, SHAPES)


def test_what_is_read_is_what_was_written(packed: Path) -> None:
    stream = np.random.default_rng(0)
    found = weights.read(packed, SHAPES)
    assert weights.names(packed) == list(found) == list(SHAPES)
    for name, shape in SHAPES.items():
        np.testing.assert_array_equal(found[name], stream.normal(size=shape).astype(np.float32))
        assert found[name].flags.writeable
        assert found[name].dtype == np.float32
    assert list(weights.read(packed, {"spread": ()})) == ["spread"]


def test_numpy_reads_them_too(packed: Path) -> None:
    found = weights.read(packed, SHAPES)
    with zipfile.ZipFile(packed) as archive:
        for name, value in found.items():
            with archive.open(entry(name)) as file:
                np.testing.assert_array_equal(np.load(file, allow_pickle=False), value)


GOOD = np.zeros(5, np.float32)


def header(**entries: object) -> bytes:
    """The header of an array of five numbers in single precision, with other entries."""
    file = io.BytesIO()
    npy.write_array_header_1_0(
        file, {"descr": "<f4", "fortran_order": False, "shape": (5,), **entries}
    )
    return file.getvalue()


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (saved(np.zeros(6, np.float32)), r"first.bias has the shape \(6,\), not \(5,\)"),
        (saved(np.zeros((5, 1), np.float32)), r"has the shape \(5, 1\), not \(5,\)"),
        (saved(np.float32(1.0)), r"has the shape \(\), not \(5,\)"),
        (saved(np.zeros(5)), "first.bias is not in single precision"),
        (saved(np.zeros(5, ">f4")), "first.bias is not in single precision"),
        (saved(np.array([None] * 5), allow_pickle=True), "damaged"),
        (saved(GOOD)[:-1], "damaged"),
        (header(), "damaged"),
        (header(shape=(-5,)) + bytes(20), "damaged"),
        (header(shape=(10**9,)) + bytes(20), "damaged"),
        (header(shape=(10**15,)) + bytes(20), "damaged"),
        (header(descr="|O") + bytes(20), "damaged"),
        (header(descr="(" * 5000) + bytes(20), "damaged"),
        (b"", "damaged"),
        (b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 70_000, "damaged"),
        (saved(GOOD).replace(b"'descr'", b"'desc\x00'"), "damaged"),
        (saved(np.full(5, np.nan, np.float32)), "weights that are not finite"),
        (saved(np.full(5, -np.inf, np.float32)), "weights that are not finite"),
    ],
)
def test_an_entry_that_is_not_what_was_expected_is_refused(
    packed: Path, content: bytes, match: str
) -> None:
    replace(packed, entry("first.bias"), content)
    refusal(packed, f"{re.escape(str(packed))}: .*{match}")


def test_a_missing_entry_is_named(packed: Path) -> None:
    with pytest.raises(ValueError, match=r"model\.json describes \(last\.bias is missing\)"):
        weights.read(packed, {**SHAPES, "last.bias": (4,)})


def test_a_network_beyond_the_limit_is_refused(packed: Path) -> None:
    with pytest.raises(
        ValueError, match=rf"a network of {MAX_WEIGHTS + 1:,} weights; at most {MAX_WEIGHTS:,}"
    ):
        weights.read(packed, {"wide": (MAX_WEIGHTS + 1,)})


def test_an_entry_beyond_the_size_limit_is_not_unpacked(
    packed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(weights, "MAX_WEIGHTS", 1000)
    replace(packed, entry("first.bias"), saved(np.zeros(10**6, np.float32)))
    assert packed.stat().st_size < 1e4
    refusal(packed, r"first.bias takes 4,000,128 bytes")


def quietly(read: Callable[[], object]) -> bool:
    """Whether a file was read; the only error allowed is ValueError."""
    try:
        read()
    except ValueError:
        return False
    return True


def test_damage_is_refused_or_harmless_wherever_it_is(packed: Path) -> None:
    whole, good = packed.read_bytes(), weights.read(packed, SHAPES)
    stream = np.random.default_rng(0)
    refused = 0
    for at in range(0, len(whole), 3):
        broken = bytearray(whole)
        broken[at] ^= 1 << int(stream.integers(8))
        packed.write_bytes(broken)
        if quietly(lambda: weights.names(packed)) and quietly(lambda: weights.read(packed, SHAPES)):
            for name, value in weights.read(packed, SHAPES).items():
                np.testing.assert_array_equal(value, good[name])
        else:
            refused += 1
    assert refused > 0.1 * len(whole)
    for length in range(0, len(whole), 7):
        packed.write_bytes(whole[:length])
        assert not quietly(lambda: weights.read(packed, SHAPES)), length
