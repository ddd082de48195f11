# SPDX-License-Identifier: BSD-3-Clause
"""The command doctor: exit code, output, and a check that fails itself."""
import json
import re

from doctor_machine import FakeMachine
from m2wr_tools.doctor import command
from m2wr_tools.doctor.finding import Finding, some, worst
from m2wr_tools.doctor.machine import Machine


def test_the_exit_code_is_the_worst_level():
    entries = [Finding("master", "ok", "", ""), Finding("master", "warning", "", "x")]
    assert worst([]) == "ok" and worst(entries) == "warning"
    assert worst(entries + [Finding("master", "problem", "", "x")]) == "problem"
    assert some("cab", 2) == "a, b and 1 more"


def test_a_check_that_fails_leaves_the_others():
    found = command._guarded("display", lambda: 1 / 0)
    assert found[0].level == "warning" and "ZeroDivisionError" in found[0].what


def test_json_and_text_say_the_same(capsys):
    machine = FakeMachine()
    machine.environ["ROS_MASTER_URI"] = "http://localhost:1"
    del machine.programs["ffmpeg"]
    code = command.main(["--json"], machine)
    told = json.loads(capsys.readouterr().out)
    assert told["exit_code"] == code and any("ffmpeg" in entry["what"] for entry in told["findings"])
    assert command.main(["--quiet", "__name:=doctor"], machine) == code
    text = capsys.readouterr().out
    assert "-> sudo apt install ffmpeg" in text and "  ok " not in text
    assert re.search(r"warnings, [1-9]\d* ok$", text.strip())      # what is left out is counted all the same


def test_this_machine_can_be_examined(tmp_path):
    machine = Machine()
    machine.environ.update(ROS_MASTER_URI="http://127.0.0.1:1", HOME=str(tmp_path))
    found = command.examine(machine)
    assert {entry.area for entry in found} >= {"installation", "environment", "display", "master"}
    assert not any("a check failed itself" in entry.what for entry in found)
    assert machine.writable(str(tmp_path / "new" / "folder")) and not machine.writable("/proc")
    assert machine.addresses("localhost") and not machine.accepts("127.0.0.1", 1)
