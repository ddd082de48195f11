# SPDX-License-Identifier: BSD-3-Clause
"""Relative names are meant from where the user stands, whatever PWD says."""
import os
import subprocess
import sys

import pytest

from m2wr_node.user_folder import from_user, user_folder

NODE = "import sys; from m2wr_node.user_folder import user_folder; print(user_folder())"
# starts a program as roslaunch does: elsewhere, in a session of its own
LAUNCH = ("import os, subprocess, sys; "
          "sys.stdout.write(subprocess.check_output(sys.argv[2:], cwd=sys.argv[1], preexec_fn=os.setsid).decode())")


def asked(folder, command, **environment):
    return subprocess.check_output(command, cwd=str(folder), env=dict(os.environ, **environment)).decode().strip()


@pytest.fixture
def places(tmp_path):
    for name in ("here", "home", "elsewhere"):
        (tmp_path / name).mkdir()
    return tmp_path


@pytest.mark.parametrize("prefix", [[], ["nice"], ["sh", "-c", "\"$@\"; exit $?", "sh"]])
@pytest.mark.parametrize("pwd", ["elsewhere", "", "no such folder"])
def test_a_node_asks_where_roslaunch_was_started(places, prefix, pwd):
    node = prefix + [sys.executable, "-c", NODE, "__name:=any", "__log:=/tmp/any.log"]
    found = asked(places / "here", [sys.executable, "-c", LAUNCH, str(places / "home")] + node,
                  PWD=pwd and str(places / pwd))
    assert found == str(places / "here")


def test_a_program_started_by_hand_stands_where_it_stands(places):
    assert asked(places / "here", [sys.executable, "-c", NODE], PWD=str(places / "elsewhere")) == str(places / "here")


def test_without_proc_the_environment_is_the_next_best(places, monkeypatch):
    monkeypatch.setattr(os, "readlink", lambda _: (_ for _ in ()).throw(FileNotFoundError()))
    monkeypatch.setenv("PWD", str(places / "here"))
    assert user_folder(["node", "__log:=/tmp/any.log"]) == str(places / "here")
    monkeypatch.setenv("PWD", "")
    assert user_folder(["node", "__log:=/tmp/any.log"]) == os.getcwd()


def test_names(places, monkeypatch):
    monkeypatch.chdir(places / "here")
    monkeypatch.setenv("HOME", "/home/me")
    assert from_user("run.bag") == str(places / "here" / "run.bag") and from_user("/tmp/run.bag") == "/tmp/run.bag"
    assert from_user("~/run.bag") == "/home/me/run.bag" and from_user("") == ""
    assert from_user("../run.bag") == str(places / "run.bag")
