# SPDX-License-Identifier: BSD-3-Clause
"""The state that a run keeps: written beside, taken only by the same run, gone after a good end."""
import os
import time

import pytest

from m2wr_gmapping.io import state
from m2wr_gmapping.ros import state_autosave
from m2wr_gmapping.ros.state_autosave import StateAutosave


class Mapper:
    """What the keeper hands on."""


class Loaded:
    def __init__(self, host):
        self.host, self.mapper = host, self
        self.closed = False

    def close(self):
        self.closed = True


@pytest.fixture
def files(monkeypatch):
    """States in memory, by path; a file on disk stands for each."""
    kept = {}

    def save(path, taken):
        if not os.path.isdir(os.path.dirname(path)):
            raise state.StateError("no folder")
        kept[path] = Loaded(taken[1])
        with open(path, "w"):
            pass
    monkeypatch.setattr(state, "snapshot", lambda mapper, host: (mapper, host))
    monkeypatch.setattr(state, "save", save)
    monkeypatch.setattr(state, "load", lambda path, config: kept[path])
    return kept


def finished(autosave):
    autosave._writer.join()


def test_state_is_found_only_by_its_own_run(files, tmp_path):
    path = str(tmp_path / "slam.state")
    autosave = StateAutosave(path, "run 1", 1e-9)
    assert autosave.resume(None) is None and autosave.due()
    autosave.keep(Mapper(), dict(counted=7))
    finished(autosave)
    assert StateAutosave(path, "run 1", 60.0).resume(None).host == dict(counted=7, run="run 1")
    assert StateAutosave(path, "run 2", 60.0).resume(None) is None and files[path].closed
    autosave.forget()
    assert not os.path.exists(path) and StateAutosave(path, "run 1", 60.0).resume(None) is None
    autosave.forget()


def test_autosave_is_due_after_a_period_unless_writing(files, tmp_path, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    autosave = StateAutosave(str(tmp_path / "slam.state"), "run", 60.0)
    assert not autosave.due()
    now[0] = 161.0
    assert autosave.due()
    autosave.keep(Mapper(), {})
    finished(autosave)
    assert not autosave.due()
    now[0] = 222.0
    assert autosave.due()
    monkeypatch.setattr(autosave._writer, "is_alive", lambda: True)
    assert not autosave.due()


def test_no_autosave_without_period_or_file(tmp_path):
    for autosave in (StateAutosave(str(tmp_path / "slam.state"), "run", 0.0), StateAutosave("", "", 1e-9)):
        assert not autosave.due() and autosave.resume(None) is None
        autosave.forget()


def test_unreadable_or_unwritable_state_is_no_failure(files, tmp_path, monkeypatch):
    autosave = StateAutosave(str(tmp_path / "nowhere" / "slam.state"), "run", 1e-9)
    autosave.keep(Mapper(), {})
    finished(autosave)
    autosave.forget()
    path = tmp_path / "slam.state"
    path.write_bytes(b"no state")

    def refuse(*_):
        raise state.StateError("no state")
    monkeypatch.setattr(state, "load", refuse)
    assert StateAutosave(str(path), "run", 60.0).resume(None) is None


def test_full_disk_is_reported_once(files, tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(state_autosave.rospy, "logwarn", lambda text, *_: told.append(text))
    monkeypatch.setattr(state_autosave.rospy, "loginfo", lambda text, *_: told.append(text))
    folder = tmp_path / "logs"
    autosave = StateAutosave(str(folder / "slam.state"), "run", 1e-9)

    def keep(times):
        for _ in range(times):
            autosave.keep(Mapper(), {})
            finished(autosave)
        return len(told)
    assert keep(3) == 1 and "after a crash the map would be lost" in told[0]
    folder.mkdir()
    assert keep(3) == 2 and "autosave works again" in told[1]
    (folder / "slam.state").unlink()
    folder.rmdir()
    assert keep(3) == 3 and told[2] == told[0]


def test_warning_mentions_an_older_state(files, tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(state_autosave.rospy, "logwarn", lambda text, *_: told.append(text))
    autosave = StateAutosave(str(tmp_path / "slam.state"), "run", 1e-9)
    autosave.keep(Mapper(), {})
    finished(autosave)

    def refuse(*_):
        raise state.StateError("the disk is full; what was there before is kept")
    monkeypatch.setattr(state, "save", refuse)
    autosave.keep(Mapper(), {})
    finished(autosave)
    assert told == ["the disk is full; what was there before is kept: after a crash the map would continue from "
                    "the older state"]


def test_new_launch_on_the_same_master_is_a_new_run(monkeypatch):
    monkeypatch.setattr(state_autosave.rospy, "get_param", lambda *_: "some-id")
    words = ["slam_gmapping", "__name:=slam_gmapping", "__log:=/logs/some-id/slam_gmapping-8.log"]
    path, run = state_autosave.autosave_location(words)
    assert path == "/logs/some-id/slam_gmapping-8.state" and state_autosave.autosave_location(words) == (path, run)
    monkeypatch.setattr(state_autosave, "starter", lambda: os.getpid())
    assert state_autosave.autosave_location(words) != (path, run)
    assert state_autosave.autosave_location(["slam_gmapping"]) == ("", "")
