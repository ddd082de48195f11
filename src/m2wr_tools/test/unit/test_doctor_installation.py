# SPDX-License-Identifier: BSD-3-Clause
"""The doctor on the installation: without a fault, and with each of the faults that it reports."""
import pytest

from doctor_machine import FakeMachine, FakePackages, faults, one_fault
from m2wr_tools.doctor import clients, installation
from m2wr_tools.doctor.machine import Machine


def install(machine, **packages):
    return installation.check(machine, FakePackages(machine, **packages))


def test_a_sound_installation_has_no_faults():
    found = install(FakeMachine())
    assert found and not faults(found)


@pytest.mark.parametrize("changes, packages, level, words", [
    ({"version": (3, 6, 9)}, {}, "problem", ("3.6.9", "3.8")),
    ({"missing": {"rospy"}}, {}, "problem", ("rospy", "apt install python3-rospy")),
    ({"missing": {"xacro"}}, {}, "problem", ("xacro", "setup.bash", "make setup")),
    ({"missing": {"trimesh"}}, {}, "warning", ("trimesh", "meshes")),
    ({"missing": {"numba"}}, {}, "warning", ("numba", "slower", "python3-numba")),
    ({"kernels": []}, {}, "warning", ("no compiled kernels", "warm_up")),
    ({}, {"missing": ("m2wr_sim",)}, "problem", ("not sourced", "setup.bash")),
    ({}, {"missing": ("motion_plan",)}, "problem", ("motion_plan", "make build")),
    ({}, {"missing": ("rviz",)}, "warning", ("rviz", "make setup")),
    ({}, {"twice": ("m2wr_sim",)}, "warning", ("2 times", "/old/src/m2wr_sim is shadowed")),
    ({"absent": {"/gone"}}, {"roots": ("/ws/src", "/gone")}, "warning", ("/gone", "new shell")),
    ({"files": {}}, {}, "problem", ("not built", "make build")),
    ({}, {"sourced": "/other/m2wr_description"}, "problem",
     ("/ws/src/m2wr_description", "/other/m2wr_description", "multiple files named", "another name")),
    ({"programs": {name: name for name in ("roscore", "roslaunch", "rosrun", "python3")}}, {}, "warning",
     ("#!/usr/bin/env python\"", "127", "sudo apt install python-is-python3")),
    ({"missing": {"tf"}}, {}, "warning", ("Python module tf", "sudo apt install python3-tf")),
    ({}, {"missing": ("topic_tools",)}, "warning", ("package topic_tools", "libtopic-tools-dev")),
    ({"absent": {prefix + "/%s/tf/static_transform_publisher" % place for place in ("lib", "share")
                 for prefix in ("/ws/devel", "/usr", "/opt/ros/noetic")} | {"/opt/ros/noetic/setup.bash"}}, {},
     "warning", ("tf/static_transform_publisher", "sudo apt install tf-tools")),
    ({"missing": {"tf"}, "absent": set()}, {}, "warning", ("Python module tf", "sudo apt install ros-noetic-tf")),
    ({"texts": {}}, {}, "warning", ("cannot be read", "again")),
    ({"texts": {"/ws/src/m2wr_sim/" + clients.LIST: "python3-tf tf modul tf\n"}}, {}, "warning",
     ("line 1", "modul tf")),
    ({"broken": {"/ws/devel/lib/m2wr_sim/demo"}}, {}, "problem", ("not executable", "chmod +x")),
    ({"files": {"/ws/devel/lib/m2wr_sim/demo": b"#!/usr/bin/python3\r\n"}}, {}, "problem", ("Windows", "sed -i")),
])
def test_faults_of_an_installation(changes, packages, level, words):
    one_fault(install(FakeMachine(**changes), **packages), level, *words)


def test_all_that_is_missing_is_told_together_with_one_command():
    found = install(FakeMachine(missing={"tf"}), missing=("topic_tools",))
    one_fault(found, "warning", "Python module tf, package topic_tools", "install libtopic-tools-dev python3-tf")


def test_headers_are_searched_in_both_distributions():
    asked = []

    class Asked(FakeMachine):
        def exists(self, path):
            asked.append(path)
            return not path.endswith("nav_msgsConfig.cmake")

    one_fault(install(Asked()), "warning", "C++ of nav_msgs")
    assert "/opt/ros/noetic/share/nav_msgs/cmake/nav_msgsConfig.cmake" in asked
    assert any(path.startswith("/usr/lib/") and path.endswith("cmake/nav_msgs/nav_msgsConfig.cmake") for path in asked)


def test_the_shipped_list_can_be_read_and_names_each_thing_once():
    import os
    with open(os.path.join(os.path.dirname(__file__), "..", "..", "..", "m2wr_sim", clients.LIST)) as stream:
        entries = clients.parse(stream)
    assert len(entries) > 40 and len(set(entry[1:] for entry in entries)) == len(entries)


def test_a_package_found_twice_is_reported(tmp_path):
    for place in ("mine/thing", "ws/thing"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text("<package><name>thing</name></package>")
    (tmp_path / "devel").mkdir()
    (tmp_path / "devel/.catkin").write_text("%s;%s" % (tmp_path / "ws/other", tmp_path / "ws/thing"))
    machine = Machine()
    machine.environ.update(ROS_PACKAGE_PATH="%s:%s" % (tmp_path / "mine", tmp_path / "ws"),
                           CMAKE_PREFIX_PATH="/gone:%s" % (tmp_path / "devel"))
    packages = installation.PackageList(machine)
    assert packages.find("thing") == str(tmp_path / "mine/thing")
    assert packages.sourced("thing") == str(tmp_path / "ws/thing")
    assert packages.sourced("unknown") is None


def test_a_foreign_python_first_on_the_path():
    machine = FakeMachine(programs=dict(FakeMachine().programs, python3="/opt/conda/bin/python3"))
    assert not faults(install(machine))                     # it can import rospy
    machine.runs["python3"] = (1, "No module named rospy")
    one_fault(install(machine), "warning", "/opt/conda/bin/python3", "PATH=/usr/bin")


@pytest.mark.parametrize("entry, strange", [
    ("/opt/ros/kinetic/lib/python2.7/dist-packages", True), ("/opt/conda/lib/python3.9/site-packages", True),
    ("/opt/anaconda/lib", True), ("/ws/devel/lib/python3/dist-packages", False),
    ("/ws/.venv/lib/python3.11/site-packages", False), ("/home/me/python_things", False)])
def test_modules_of_another_python(entry, strange):
    machine = FakeMachine()
    machine.environ["PYTHONPATH"] = entry
    found = faults(install(machine))
    assert bool(found) == strange and all(entry in fault.what for fault in found)


def test_files_that_tools_leave_are_no_executables():
    files = {"/ws/devel/lib/m2wr_sim/cmake.lock": b"", "/ws/devel/lib/m2wr_sim/demo": b"#!/usr/bin/python3\n"}
    assert not faults(install(FakeMachine(files=files, broken={"/ws/devel/lib/m2wr_sim/cmake.lock"})))


def test_packages_are_found_where_they_are(tmp_path):
    for place in ("one/thing", "two/deep/thing", "two/left_out/thing"):
        (tmp_path / place).mkdir(parents=True)
        (tmp_path / place / "package.xml").write_text("<package><name>thing</name></package>")
    (tmp_path / "two/left_out/CATKIN_IGNORE").write_text("")
    machine = Machine()
    machine.environ["ROS_PACKAGE_PATH"] = "%s:%s" % (tmp_path / "one", tmp_path / "two")
    packages = installation.PackageList(machine)
    assert packages.find("thing") == str(tmp_path / "one/thing")
    assert packages.copies("thing") == [str(tmp_path / "one/thing"), str(tmp_path / "two/deep/thing")]
