# SPDX-License-Identifier: BSD-3-Clause
"""What the spawner waits for, calls and says, with a controller manager made of functions."""
import logging
import time
from types import SimpleNamespace

import pytest
import rospy

from controller_manager import command, controller_manager_interface, spawner


@pytest.fixture
def calls(monkeypatch):
    """Answer all services with ok, but those in ``refused``; returns the list of calls."""
    made, refused = [], set()

    def call(service, *values, namespace=""):
        made.append((namespace, service) + values)
        return SimpleNamespace(ok=not refused & {service, str(values[:1])[2:-3]}, controller=[], types=["a/B"])

    monkeypatch.setattr(controller_manager_interface, "call", call)
    for name in ("init_node", "spin"):
        monkeypatch.setattr(rospy, name, lambda *values, **more: None)
    monkeypatch.setattr(rospy, "on_shutdown", lambda function: made.append(("end", function)))
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: default)
    monkeypatch.setattr(spawner, "managers", lambda: ["/", "/husky"])
    return SimpleNamespace(made=made, refused=refused)


def test_controllers_start_together_and_end_in_reverse(calls):
    assert spawner.main(["--namespace", "/husky", "states", "drive"]) == 0
    (_, end), = [call for call in calls.made if call[0] == "end"]
    assert [call for call in calls.made if call[0] != "end"] == [
        ("/husky", "load_controller", "states"), ("/husky", "load_controller", "drive"),
        ("/husky", "switch_controller", ["states", "drive"], [], 2, False, 0.0)]
    calls.made.clear()
    end()
    assert calls.made == [("/husky", "switch_controller", [], ["drive", "states"], 1, False, 0.0),
                          ("/husky", "unload_controller", "drive"), ("/husky", "unload_controller", "states")]


def test_stopped_only_loads(calls):
    assert spawner.main(["--stopped", "arm"]) == 0
    assert [call[1] for call in calls.made if call[0] == ""] == ["load_controller"]


def test_controllers_that_load_are_started_without_the_others(calls):
    calls.refused.add("arm")
    assert spawner.main(["arm", "drive"]) == 0
    assert ("", "switch_controller", ["drive"], [], 2, False, 0.0) in calls.made


@pytest.mark.parametrize("refused", ["arm", "switch_controller"])
def test_nothing_started_ends_with_1(calls, refused):
    calls.refused.add(refused)
    assert spawner.main(["arm"]) == 1


def test_missing_manager_is_told_with_those_that_exist(calls, caplog, monkeypatch):
    monkeypatch.setattr(spawner, "_PAUSE", 0.01)
    with caplog.at_level(logging.ERROR, "rosout"):
        assert spawner.main(["--timeout", "0.05", "--namespace", "jackal", "drive"]) == 1
    assert "couldn't find the expected controller_manager ROS interface" in caplog.text
    assert "no service /jackal/controller_manager/load_controller; robots with a" in caplog.text
    assert "controller manager: /, /husky" in caplog.text


def test_simulator_that_ends_meanwhile_is_told(calls, caplog, monkeypatch):
    def call(*values, **more):
        raise rospy.ServiceException("transport error")
    monkeypatch.setattr(controller_manager_interface, "call", call)
    with caplog.at_level(logging.ERROR, "rosout"):
        assert spawner.main(["drive"]) == 1
    assert "transport error. Has the simulator ended?" in caplog.text


def test_end_does_not_wait_for_a_simulator_that_is_gone(monkeypatch):
    monkeypatch.setattr(spawner, "_FAREWELL", 0.05)
    monkeypatch.setattr(controller_manager_interface, "call", lambda *values, **more: time.sleep(5.0))
    began = time.monotonic()
    spawner.remove(["drive", "states"], "")
    assert time.monotonic() - began < 2.0


def test_file_of_controllers_is_loaded(calls, tmp_path, monkeypatch):
    (tmp_path / "control.yaml").write_text("drive: {type: a/B}\nstates: {type: c/D}\n")
    sent = []
    monkeypatch.setattr(spawner.rosparam, "upload_params", lambda namespace, values: sent.append((namespace, values)))
    assert spawner.main([str(tmp_path / "control.yaml")]) == 0
    assert sent == [("/", {"drive": {"type": "a/B"}, "states": {"type": "c/D"}})]
    assert ("", "switch_controller", ["drive", "states"], [], 2, False, 0.0) in calls.made


@pytest.mark.parametrize("words, service, printed", [
    (["load", "arm"], "load_controller", "Loaded 'arm'"),
    (["start", "arm"], "switch_controller", "Started ['arm'] successfully"),
    (["stop", "arm"], "switch_controller", "Stopped ['arm'] successfully"),
    (["lt"], "list_controller_types", "a/B"),
    (["list"], "list_controllers", "No controllers are loaded")])
def test_commands_print_what_they_did(calls, capsys, words, service, printed):
    assert command.main(words) == 0
    assert printed in capsys.readouterr().out and calls.made[-1][1] == service


def test_command_that_fails_ends_with_1(calls, capsys):
    calls.refused.add("switch_controller")
    assert command.main(["start", "arm"]) == 1
    assert "Error when starting ['arm']" in capsys.readouterr().out


def test_command_without_a_master_says_so(calls, capsys, monkeypatch):
    def init_node(*values, **more):
        raise rospy.exceptions.ROSInitException("Failed to initialize time")
    monkeypatch.setattr(rospy, "init_node", init_node)
    assert command.main(["list"]) == 1
    assert "Failed to initialize time. Is there a master" in capsys.readouterr().err
