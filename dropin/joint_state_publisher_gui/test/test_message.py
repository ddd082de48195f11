# SPDX-License-Identifier: BSD-3-Clause
"""The message, and what runs in place of the window."""
import os
import runpy
import sys

import pytest
import roslib.packages

SCRIPT = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "scripts",
                      "joint_state_publisher_gui")


@pytest.fixture
def main():
    return runpy.run_path(SCRIPT, run_name="script")["main"]


def test_the_publisher_without_a_window_gets_all_arguments(main, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [SCRIPT, "__name:=sliders", "_rate:=5"])
    calls = []
    main(lambda package, name: ["/%s/%s" % (package, name)], lambda *call: calls.append(call))
    assert calls == [(sys.executable, [sys.executable, "/joint_state_publisher/joint_state_publisher",
                                       "__name:=sliders", "_rate:=5"])]
    assert "there is no window here" in capsys.readouterr().err


def missing(package, name):
    raise roslib.packages.ROSPkgException(package)


@pytest.mark.parametrize("find", [missing, lambda package, name: []])
def test_without_that_publisher_it_says_what_to_install(main, capsys, find):
    assert main(find, pytest.fail) == 1
    assert "sudo apt install joint-state-publisher" in capsys.readouterr().err
