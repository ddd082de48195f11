# SPDX-License-Identifier: BSD-3-Clause
"""Files that are whole or not there, and what is no file is left what it is."""
import os
import stat
import threading

import pytest

from m2wr_files.atomic_files import write_atomically


def listing(folder):
    return sorted(path.name for path in folder.iterdir())


def test_all_files_or_none(tmp_path):
    (tmp_path / "a").write_text("old")
    with pytest.raises(OSError):
        write_atomically((str(tmp_path / "a"), [b"new"]), (str(tmp_path / "nowhere" / "b"), [b"new"]))
    assert (tmp_path / "a").read_text() == "old" and listing(tmp_path) == ["a"]
    write_atomically((str(tmp_path / "a"), [b"new", b"er"]), (str(tmp_path / "b"), [memoryview(b"x")]))
    assert (tmp_path / "a").read_text() == "newer" and listing(tmp_path) == ["a", "b"]


def test_an_interrupt_leaves_nothing_behind(tmp_path):
    def parts():
        yield b"half"
        raise KeyboardInterrupt
    (tmp_path / "a").write_text("old")
    with pytest.raises(KeyboardInterrupt):
        write_atomically((str(tmp_path / "b"), [b"whole"]), (str(tmp_path / "a"), parts()))
    assert (tmp_path / "a").read_text() == "old" and listing(tmp_path) == ["a"]


def test_symlink_is_kept(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "near").symlink_to(tmp_path / "far" / "a")
    for text in (b"one", b"two"):
        write_atomically((str(tmp_path / "near"), [text]))
        assert (tmp_path / "near").is_symlink() and (tmp_path / "far" / "a").read_bytes() == text
    assert listing(tmp_path / "far") == ["a"]


def test_pipe_is_written_to(tmp_path):
    pipe, read = str(tmp_path / "pipe"), []
    os.mkfifo(pipe)

    def listen():
        with open(pipe, "rb") as stream:
            read.append(stream.read())
    listener = threading.Thread(target=listen)
    listener.start()
    write_atomically((pipe, [b"said"]))
    listener.join()
    assert read == [b"said"] and stat.S_ISFIFO(os.stat(pipe).st_mode) and listing(tmp_path) == ["pipe"]


def test_standard_streams_are_written_to(capfd):
    write_atomically(("/dev/stdout", [b"out"]), ("/dev/null", [b"lost"]))
    assert capfd.readouterr().out == "out" and stat.S_ISCHR(os.stat("/dev/null").st_mode)


def test_folder_is_not_replaced(tmp_path):
    (tmp_path / "a").mkdir()
    with pytest.raises(OSError):
        write_atomically((str(tmp_path / "a"), [b"new"]))
    assert listing(tmp_path) == ["a"] and listing(tmp_path / "a") == []
