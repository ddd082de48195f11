# SPDX-License-Identifier: BSD-3-Clause
"""The doctor on environment and display: without a fault, and with each of the faults that it reports."""
import pytest

from doctor_machine import FakeMachine, environment_findings, faults, one_fault
from m2wr_tools.doctor import environment


def test_a_sound_environment_has_no_faults():
    assert not faults(environment_findings())
    assert not faults(environment.check_display(FakeMachine()))


@pytest.mark.parametrize("variables, level, words", [
    ({"ROS_MASTER_URI": "localhost:11311"}, "problem", ("http://HOST:PORT",)),
    ({"ROS_MASTER_URI": "http://localhost:many"}, "problem", ("http://HOST:PORT",)),
    ({"ROS_MASTER_URI": "http://nowhere:11311"}, "problem", ("nowhere", "/etc/hosts")),
    ({"ROS_HOSTNAME": "nowhere"}, "problem", ("no address", "ROS_HOSTNAME=localhost")),
    ({"ROS_HOSTNAME": ""}, "problem", ("host name is laptop", "no address")),
    ({"ROS_HOSTNAME": "other"}, "problem", ("10.0.0.9 is not an address of this machine", "unset ROS_IP")),
    ({"ROS_IP": "127.0.0.1"}, "warning", ("both set", "unset ROS_IP"))])
def test_faults_of_an_environment(variables, level, words):
    one_fault(environment_findings(**variables), level, *words)


def test_a_folder_that_cannot_be_written():
    one_fault(environment_findings(FakeMachine(locked={"/home/me/.ros/log"})), "problem", ".ros/log", "ROS_LOG_DIR")
    one_fault(environment_findings(FakeMachine(locked={"/home/me"})), "warning", "bags and pictures", "record:=")


@pytest.mark.parametrize("free, level", [(50 << 20, "problem"), (1 << 30, "warning")])
def test_a_full_disk(free, level):
    found = faults(environment_findings(FakeMachine(free=free)))
    assert {entry.level for entry in found} == {level} and all("MB are free" in entry.what for entry in found)


def test_no_display_is_no_fault():
    machine = FakeMachine()
    machine.environ["DISPLAY"] = ""
    found = environment.check_display(machine)
    assert not faults(found) and "DISPLAY is not set" in found[0].what


@pytest.mark.parametrize("display, words", [(":1", ("DISPLAY :1 does not answer", "ssh -X")),
                                            ("screen", ("like :0",)), ("other:10.0", ("does not answer",))])
def test_a_display_that_is_not_there(display, words):
    machine = FakeMachine()
    machine.environ["DISPLAY"] = display
    one_fault(environment.check_display(machine), "warning", *words)


def test_a_display_over_the_network():
    machine = FakeMachine(open_ports={("other", 6010)})
    machine.environ["DISPLAY"] = "other:10.0"
    assert not faults(environment.check_display(machine))


def test_graphics_that_do_not_work():
    machine = FakeMachine(runs={"glxinfo": (1, "Error: couldn't find RGB GLX visual")})
    one_fault(environment.check_display(machine), "warning", "OpenGL", "LIBGL_ALWAYS_SOFTWARE=1")


@pytest.mark.parametrize("program", ["Xvfb", "ffmpeg"])
def test_programs_for_pictures(program):
    machine = FakeMachine()
    del machine.programs[program]
    one_fault(environment.check_display(machine), "warning", program, "apt install " + program.lower())
