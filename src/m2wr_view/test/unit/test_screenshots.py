# SPDX-License-Identifier: BSD-3-Clause
"""Screenshots in files, the tool that takes one, and rviz as a node that ends no run."""
import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from m2wr_node import user_folder
from m2wr_view.errors import ViewError
from m2wr_view.ros import rviz_window, screenshot, virtual_display
from m2wr_view.ros.processes import Child, find_program, make_folder
from m2wr_view.screenshots import Screenshots

RED = Image.new("RGB", (30, 20), (200, 10, 10))


# ---- files -----------------------------------------------------------------------------------------------------

def test_files_are_numbered_after_those_that_are_there(tmp_path):
    (tmp_path / "0007_end.png").write_bytes(b"kept")
    (tmp_path / "notes.png").write_bytes(b"")
    shots = Screenshots(str(tmp_path))
    paths = [shots.save(RED, why) for why in ("wall following", "../../etc/x", "")]
    assert [os.path.basename(path) for path in paths] == ["0008_wall_following.png", "0009_etc_x.png",
                                                          "0010_picture.png"]
    assert (tmp_path / "0007_end.png").read_bytes() == b"kept"
    with Image.open(paths[0]) as found:
        assert np.array_equal(np.asarray(found), np.asarray(RED))


def test_a_folder_that_cannot_be_had_is_named():
    with pytest.raises(ViewError, match="/proc/none"):
        Screenshots("/proc/none")


def test_a_full_disk_is_named_and_leaves_no_half_picture(tmp_path):
    code = ("import resource, sys; from PIL import Image; from m2wr_view.screenshots import Screenshots\n"
            "from m2wr_view.errors import ViewError\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (50, 50))\n"
            "try:\n    Screenshots(%r).save(Image.new('RGB', (300, 200)), 'end')\n"
            "except ViewError as error:\n    sys.exit(str(error))" % str(tmp_path))
    done = subprocess.run([sys.executable, "-c", code], stderr=subprocess.PIPE, universal_newlines=True, timeout=30)
    assert done.returncode == 1 and "0000_end.png" in done.stderr and "free space on the disk" in done.stderr
    assert os.listdir(str(tmp_path)) == []


# ---- the tool --------------------------------------------------------------------------------------------------

def take(tmp_path, words, state, environment=None):
    """Take a picture with a faked master; the service saves RED."""
    saved = tmp_path / "saved.png"
    RED.save(str(saved))
    asked = []

    def ask(name):
        asked.append(name)
        return str(saved)

    return screenshot.take(screenshot._parser().parse_args(words), environment or {}, ask, lambda: state), asked


def test_the_one_virtual_display_is_asked(tmp_path):
    path, asked = take(tmp_path, [], [["/rosout/get_loggers", []], ["/virtual_display/screenshot", []]])
    assert asked == ["/virtual_display/screenshot"] and path == str(tmp_path / "saved.png")


def test_the_picture_is_copied_where_it_is_wanted(tmp_path):
    out = str(tmp_path / "mine.png")
    path, _ = take(tmp_path, ["--out", out], [["/virtual_display/screenshot", []]])
    assert path == out and Image.open(out).size == RED.size
    with pytest.raises(ViewError, match="it is at .*saved.png"):
        take(tmp_path, ["--out", "/proc/none/x.png"], [["/virtual_display/screenshot", []]])


def test_of_several_displays_one_must_be_chosen(tmp_path):
    state = [["/a/screenshot", []], ["/b/screenshot", []]]
    with pytest.raises(ViewError, match="several.*--service.*/a/screenshot, /b/screenshot"):
        take(tmp_path, [], state)
    assert take(tmp_path, ["--service", "b/screenshot"], state)[1] == ["/b/screenshot"]
    with pytest.raises(ViewError, match="no service /c/screenshot.*/a/screenshot"):
        take(tmp_path, ["--service", "/c/screenshot"], state)


def test_without_anything_to_take_it_says_what_to_do(tmp_path):
    with pytest.raises(ViewError, match="virtual_display:=true.*DISPLAY is not set"):
        take(tmp_path, [], [])


def test_a_display_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ViewError, match="display :987"):
        take(tmp_path, ["--display", ":987", "--out", str(tmp_path / "x.png")], [])


# ---- parameters of the node ------------------------------------------------------------------------------------

@pytest.mark.parametrize("name, value", [
    ("size", [10, 720]), ("size", "big"), ("size", [1280.5, 720]), ("size", [True, 720]), ("period", -1.0),
    ("period", float("nan")), ("period", "often"), ("frame_rate", 0.0), ("distance", 0.0), ("distance", float("inf")),
    ("view", "bird"), ("config", "")])
def test_a_parameter_that_makes_no_sense_is_named(name, value):
    values = {"~config": "/a.rviz", "~" + name: value}
    with pytest.raises(ViewError, match="~" + name):
        virtual_display.read_parameters(lambda key, default: values.get(key, default))


def test_relative_folders_count_from_where_roslaunch_was_started(monkeypatch):
    monkeypatch.setattr(user_folder, "user_folder", lambda words=None: "/home/me")
    config = virtual_display.read_parameters(lambda key, default: {"~config": "/a.rviz"}.get(key, default))
    assert config.out == "/home/me/screenshots" and config.size == (1280, 720) and config.frame_rate == 10.0


def test_every_parameter_is_in_the_reference():
    asked = []
    virtual_display.read_parameters(lambda key, default: asked.append(key) or ("/a.rviz" if not default else default))
    folder = os.path.dirname(os.path.abspath(__file__))
    page = os.path.join(folder, "..", "..", "..", "..", "docs", "reference", "m2wr_view.md")
    with open(page, encoding="utf-8") as stream:
        section = stream.read().split("| parameter of `virtual_display`")[1].split("\n\n")[0]
    assert len(asked) > 5 and set(re.findall(r"^\| `(~\w+)`", section, re.M)) == set(asked)


# ---- rviz in a window ------------------------------------------------------------------------------------------

def test_no_display_is_a_message_and_no_failure(monkeypatch, capfd):
    monkeypatch.delenv("DISPLAY", raising=False)
    assert rviz_window.main(["-d", "x.rviz"]) == 0
    assert "DISPLAY is not set" in capfd.readouterr().err


def test_a_display_that_cannot_be_opened_is_named(monkeypatch, capfd):
    monkeypatch.setenv("DISPLAY", ":987")
    assert rviz_window.main(["-d", "x.rviz"]) == 0
    assert "display :987 (DISPLAY) cannot be opened" in capfd.readouterr().err


def test_a_display_that_never_answers_is_given_up():
    def silent(*_, **options):
        raise subprocess.TimeoutExpired("python3", options["timeout"])

    assert "has not answered" in rviz_window.display_problem({"DISPLAY": "far:0"}, silent)
    assert rviz_window.display_problem({"DISPLAY": ":0"}, lambda *_, **options: 1) is None


@pytest.mark.parametrize("ending, told", [("kill -9 $$", "signal 9"), ("exit 7", "code 7"), ("exit 0", None)])
def test_end_of_rviz_does_not_end_the_run(monkeypatch, tmp_path, capfd, ending, told):
    program = tmp_path / "rviz"
    program.write_text("#!/bin/sh\n%s\n" % ending)
    program.chmod(0o755)
    monkeypatch.setenv("PATH", "%s:%s" % (tmp_path, os.environ["PATH"]))
    monkeypatch.setattr(rviz_window, "display_problem", lambda environment: None)
    assert rviz_window.main([]) == 0
    said = capfd.readouterr().err
    assert told in said and "the run continues" in said if told else said == ""


# ---- processes -------------------------------------------------------------------------------------------------

def test_a_missing_program_is_named_with_its_package():
    with pytest.raises(ViewError, match="no program Xvfb7; install it .apt install xvfb"):
        find_program("Xvfb7", "xvfb")


def test_how_a_process_ended_is_told_with_its_last_words(tmp_path):
    child = Child(["sh", "-c", "echo one; echo two; echo three; echo no room >&2; exit 3"], str(tmp_path / "log"),
                  dict(os.environ))
    child._process.wait(10)
    assert not child.alive() and child.end() == "code 3: two / three / no room"


def test_folders_of_killed_displays_are_deleted(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "m2wr_display_strange").mkdir()         # whose it is cannot be told
    used, used_lock = make_folder()
    left, left_lock = make_folder()
    left_lock.close()                                   # as the end of its process does
    new, new_lock = make_folder()
    assert not os.path.exists(left)
    assert sorted(map(str, tmp_path.iterdir())) == sorted([used, new, str(tmp_path / "m2wr_display_strange")])
    used_lock.close()
    new_lock.close()


def test_a_process_goes_when_the_one_that_started_it_is_killed(tmp_path):
    code = ("import os, sys; from m2wr_view.ros.processes import Child\n"
            "child = Child(['sleep', '60'], %r, dict(os.environ)); print(child.pid, flush=True)\n"
            "os.kill(os.getpid(), 9)" % str(tmp_path / "log"))
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, timeout=30)
    pid, deadline = int(done.stdout), time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            with open("/proc/%d/stat" % pid, encoding="utf-8") as stream:
                if stream.read().rsplit(")", 1)[1].split()[0] == "Z":
                    return
        except OSError:
            return
        time.sleep(0.01)
    os.kill(pid, 9)
    raise AssertionError("process %d outlived the one that started it" % pid)


@pytest.mark.parametrize("found, config", [("/gazebo", "/sim.rviz"), (None, "/alone.rviz")])
def test_what_rviz_shows_depends_on_whether_a_simulation_runs(found, config):
    words = ["--simulation", "/sim.rviz", "-d", "/alone.rviz", "__name:=rviz"]
    assert rviz_window.chosen(words, lambda name: found) == ["-d", config, "__name:=rviz"]
    assert rviz_window.chosen(words[2:], lambda name: found) == words[2:]
