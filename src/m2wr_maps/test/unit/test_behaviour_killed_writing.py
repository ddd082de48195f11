# SPDX-License-Identifier: BSD-3-Clause
"""Killed before any single call to the system, a writer leaves a complete map and nothing that the next one keeps."""
import os
import pathlib
import signal
import sys
import tempfile

import numpy as np
import pytest
import yaml
from PIL import Image

from m2wr_files.atomic_files import PREFIX, write_atomically
from m2wr_maps import map_file

MOST_CALLS = 1000


@pytest.fixture
def folder():
    """A folder in memory where there is one: hundreds of fsync take long on a disk."""
    with tempfile.TemporaryDirectory(dir="/dev/shm" if os.access("/dev/shm", os.W_OK) else None) as path:
        yield pathlib.Path(path)


def run_killed(calls, work):
    """Run ``work`` in a child that is killed before its call number ``calls`` to the system; whether it was.

    Counted are all functions of ``posix`` and ``fcntl`` and all methods of files, of all callers.
    """
    child = os.fork()
    if not child:
        left = [calls]

        def count(_, event, function):
            owner = getattr(function, "__self__", None)
            if event == "c_call" and (getattr(function, "__module__", None) in ("posix", "fcntl")
                                      or getattr(owner, "__name__", None) in ("posix", "fcntl")
                                      or type(owner).__module__ in ("io", "_io")):
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)
        try:
            sys.setprofile(count)
            work()
        except BaseException:
            os._exit(1)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0
    return os.WIFSIGNALED(status)


def each_kill(work, prepare):
    """Yield after each way to kill ``work``; ``prepare`` makes the folder what it was."""
    for calls in range(MOST_CALLS):
        prepare()
        if not run_killed(calls, work):
            assert calls > 5
            return
        yield calls
    raise AssertionError("more than %d calls" % MOST_CALLS)


def save(folder, number):
    """Save map number 1, 2, 3: of one grey each, and with the resolution 0.1, 0.2, 0.3."""
    data = np.full((3, 4), {1: 0, 2: 100, 3: -1}[number], np.int8)
    map_file.save(str(folder / "plan"), data, 0.1 * number, [0.0, 0.0, 0.0])


def number_of(folder):
    """Return the number of the map that is read, after checking that it is a pair; None if there is none."""
    if not (folder / "plan.yaml").exists():
        return None
    described = yaml.safe_load((folder / "plan.yaml").read_text())
    number = int(round(described["resolution"] / 0.1))
    with Image.open(folder / described["image"]) as opened:
        assert set(np.asarray(opened).ravel()) == {{1: 254, 2: 0, 3: 205}[number]}, described
    return number


def empty(folder):
    for path in folder.iterdir():
        path.unlink()


@pytest.mark.parametrize("before", [None, 1])
def test_map_pair_is_consistent_after_a_kill(folder, before):
    def prepare():
        empty(folder)
        if before:
            save(folder, before)
    seen = []
    for calls in each_kill(lambda: save(folder, 2), prepare):
        seen.append(number_of(folder))
        assert seen[-1] in (before, 2), calls
        save(folder, 3)
        assert number_of(folder) == 3
        assert sorted(path.name for path in folder.iterdir()) == ["plan.pgm", "plan.yaml"], calls
    assert seen == sorted(seen, key=lambda number: number or 0) and set(seen) == {before, 2}


def test_leftovers_of_a_kill_are_removed_at_the_next_start(folder):
    def prepare():
        empty(folder)
        save(folder, 1)
    for calls in each_kill(lambda: save(folder, 2), prepare):
        number = number_of(folder)
        map_file.tidy(str(folder / "plan"))
        assert number_of(folder) == number
        named = yaml.safe_load((folder / "plan.yaml").read_text())["image"]
        assert {path.name for path in folder.iterdir()} <= {"plan.yaml", "plan.pgm", named}, calls


def test_file_is_old_or_new_after_a_kill(folder):
    path = folder / "state"
    for calls in each_kill(lambda: write_atomically((str(path), [b"new" * 9])), lambda: path.write_bytes(b"old")):
        assert path.read_bytes() in (b"old", b"new" * 9), calls
    write_atomically((str(path), [b"last"]))
    assert [entry.name for entry in folder.iterdir()] == ["state"]


def test_locked_and_foreign_files_are_kept(folder):
    (folder / "plan-0123456789ab.pgm").write_bytes(b"a picture of the user")
    (folder / (PREFIX + "notes")).write_bytes(b"")
    during = []

    def parts():
        yield b"half"
        save(folder, 1)
        during.extend(path.name for path in folder.iterdir() if path.name.startswith(PREFIX))
        yield b" and half"
    write_atomically((str(folder / "slow"), parts()))
    assert len(during) == 2 and (folder / "slow").read_bytes() == b"half and half"
    assert {path.name for path in folder.iterdir()} == {
        "plan-0123456789ab.pgm", PREFIX + "notes", "slow", "plan.pgm", "plan.yaml"}


def test_unwritable_picture_leaves_a_digest_picture(folder, caplog):
    save(folder, 1)
    (folder / "plan.pgm").unlink()
    (folder / "plan.pgm").mkdir()
    save(folder, 2)
    assert number_of(folder) == 2 and "plan.pgm" in caplog.text
