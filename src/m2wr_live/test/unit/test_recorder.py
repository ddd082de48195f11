# SPDX-License-Identifier: BSD-3-Clause
"""What pages are told where nothing can be recorded, and that a recording is bounded; without a master."""
import os
import subprocess
import sys

import pytest

from m2wr_live.ros import recorder
from m2wr_live.ros.recorder import Recorder
from m2wr_view.errors import ViewError

#: Stands for rosbag's recorder: makes the file after -O, renames it when it is interrupted.
_FAKE = """#!%s
import os, signal, sys, time
path = sys.argv[sys.argv.index("-O") + 1]
def end(*_):
    os.rename(path + ".active", path)
    sys.exit(0)
signal.signal(signal.SIGINT, end)
with open(path + ".active", "wb") as stream:
    stream.write(b"#ROSBAG V2.0")
while True:
    time.sleep(0.05)
""" % sys.executable


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A recorder over a stand-in for rosbag's."""
    program = tmp_path / "record"
    program.write_text(_FAKE)
    program.chmod(0o755)
    monkeypatch.setattr(recorder, "find_recorder", lambda: str(program))
    found = Recorder()
    yield found
    found.close()


def test_a_recording_is_kept_until_the_next_one_or_the_end(made):
    made.start()
    assert made.seconds() >= 0.0
    with pytest.raises(ViewError, match="runs already"):
        made.start()
    with pytest.raises(ViewError, match="no finished recording"):
        made.bag()
    made.stop()
    assert made.seconds() is None and made.bag() == b"#ROSBAG V2.0"
    folder = made._folder
    made.start()
    made.close()
    assert not os.path.exists(folder)


@pytest.mark.parametrize("limit", ["LONGEST", "LARGEST"])
def test_a_recording_is_ended_at_its_limits(made, monkeypatch, limit):
    made.start()
    made.watch()
    assert made.seconds() is not None
    monkeypatch.setattr(recorder, limit, 0)
    made.watch()
    assert made.seconds() is None and made.bag()


def test_a_limit_does_not_end_the_next_recording(made, monkeypatch):
    class Late:
        """A lock that is got when the next recording has begun."""

        def __enter__(self):
            made._process = following

        def __exit__(self, *_):
            return None

    made.start()
    following = subprocess.Popen(["sleep", "60"])
    first, lock = made._process, made._lock
    try:
        monkeypatch.setattr(recorder, "LONGEST", 0)
        monkeypatch.setattr(made, "_lock", Late())
        made.watch()
        assert made._process is following and following.poll() is None
    finally:
        made._process, made._lock = first, lock
        following.kill()
        following.wait()


def test_a_page_is_told_why_nothing_is_recorded(made, monkeypatch):
    for action in (made.stop, made.bag, made.film):
        with pytest.raises(ViewError, match="press \"record\""):
            action()
    monkeypatch.setattr(recorder, "find_recorder", lambda: "/bin/false")
    with pytest.raises(ViewError, match="cannot begin"):
        made.start()
    assert made.seconds() is None


def test_a_bag_that_cannot_be_drawn_is_said_with_its_reason(made):
    made.start()
    made.stop()
    with pytest.raises(ViewError, match="the film cannot be drawn: .+"):
        made.film()
