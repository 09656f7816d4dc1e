"""JSON documents that cannot be read: one sentence each."""

import pytest

from ferguson_gym.runtime.json_files import read_json


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"", "not JSON: Expecting value"),
        (b'{"a": [1, 2', "not JSON: "),
        (b"\xff\xfe{}", "not a text file: .* can't decode"),
        (b"[" * 100_000, "nested too deeply"),
        (b"[" + b"9" * 5000 + b"]", "a whole number has more digits than can be read"),
    ],
)
def test_damaged_documents_are_refused(text, message, tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(text)
    with pytest.raises(ValueError, match=message):
        read_json(path)


def test_a_byte_order_mark_is_skipped(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b"\xef\xbb\xbf[1, 2.5]")
    assert read_json(path) == [1, 2.5]
