"""Files are written whole or not at all."""

import os

import pytest

from ferguson_gym.runtime.atomic_files import atomic_write, unwritable


def test_a_block_that_succeeds_replaces_the_file(tmp_path):
    target = tmp_path / "table.csv"
    target.write_text("old")
    with atomic_write(target) as temporary:
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_a_block_that_raises_keeps_the_old_file_and_leaves_no_debris(tmp_path, error):
    target = tmp_path / "table.csv"
    target.write_text("old")

    def interrupted():
        with atomic_write(target) as temporary:
            temporary.write_text("half a li")
            raise error

    with pytest.raises(error):
        interrupted()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_raises_creates_nothing(tmp_path):
    def interrupted():
        with atomic_write(tmp_path / "table.csv"):
            raise RuntimeError

    with pytest.raises(RuntimeError):
        interrupted()
    assert not list(tmp_path.iterdir())


def test_a_failed_move_leaves_no_debris(tmp_path):
    target = tmp_path / "taken"
    target.mkdir()

    def move():
        with atomic_write(target) as temporary:
            temporary.write_text("new")

    with pytest.raises(OSError, match="taken"):
        move()
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("name", ["flight.gif", "flight.tar.gz", "flight"])
def test_the_temporary_name_lies_beside_and_keeps_the_suffix(tmp_path, name):
    target = tmp_path / name
    with atomic_write(target) as temporary:
        assert temporary.parent == tmp_path
        assert temporary.suffix == target.suffix
        assert temporary != target


def test_a_path_may_be_text(tmp_path):
    with atomic_write(str(tmp_path / "note")) as temporary:
        temporary.write_text("text")
    assert (tmp_path / "note").read_text() == "text"


@pytest.mark.skipif(os.name != "posix", reason="file modes are POSIX")
@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_a_new_file_has_the_mode_that_open_would_have_given(tmp_path, umask):
    before = os.umask(umask)
    try:
        with atomic_write(tmp_path / "whole"):
            pass
        (tmp_path / "plain").touch()
        assert os.umask(umask) == umask
    finally:
        os.umask(before)
    assert (tmp_path / "whole").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_whether_a_directory_takes_files_is_tried(tmp_path):
    assert unwritable(tmp_path) is None
    assert not list(tmp_path.iterdir())
    assert unwritable(tmp_path / "nowhere") == "No such file or directory"


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs Linux's /proc")
def test_a_directory_without_files_is_unwritable_even_for_root():
    assert unwritable("/proc") is not None
