# SPDX-License-Identifier: BSD-3-Clause
"""What to do about a missing package."""
from doctor_machine import FakeMachine
from m2wr_tools.doctor.package_sources import how_to_get

SHOWN = ("Package: joy\nDescription: a game\n\nPackage: ros-joy\nDescription: Robot OS joysticks\n\n"
         "Package: other\nDescription: Robot OS\n")


def test_debian_packages_are_named_only_if_they_are_of_ros():
    machine = FakeMachine(runs={"apt-cache": (0, SHOWN)})
    machine.environ["CMAKE_PREFIX_PATH"] = ""
    assert how_to_get(machine, "joy") == "sudo apt install ros-joy"
    assert "clone its source" in how_to_get(FakeMachine(environ={}), "my_robot")


def test_ubuntu_has_names_of_its_own():
    machine = FakeMachine()
    machine.absent.discard("/opt/ros/noetic/setup.bash")
    machine.environ["CMAKE_PREFIX_PATH"] = ""
    assert "ros-noetic-my-robot" in how_to_get(machine, "my_robot")


def test_windows_have_a_command_instead():
    assert "dynparam" in how_to_get(FakeMachine(), "rqt_reconfigure")
    assert "correct its name" in how_to_get(FakeMachine(), "a b; rm -rf")


def test_a_stand_in_that_is_not_built_is_named():
    machine = FakeMachine()
    machine.environ["CMAKE_PREFIX_PATH"] = "/ws/devel"
    assert "make build" in how_to_get(machine, "twist_mux")
