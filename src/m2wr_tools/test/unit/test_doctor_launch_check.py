# SPDX-License-Identifier: BSD-3-Clause
"""Findings on a launch file: missing packages and programs, plugins that are left out, worlds."""
import os

import pytest

from m2wr_tools.doctor import command, launch_check
from m2wr_tools.doctor.installation import PackageList
from m2wr_tools.doctor.machine import Machine

ROBOT = """<robot name="box" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="lib" default="unknown"/>%s
<link name="base"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<gazebo><plugin name="p" filename="lib$(arg lib).so"/></gazebo></robot>"""


@pytest.fixture(scope="module")
def machine():
    return Machine()


@pytest.fixture(scope="module")
def packages(machine):
    return PackageList(machine)


def examine(machine, packages, folder, text, **arguments):
    (folder / "top.launch").write_text("<launch>%s</launch>" % text)
    found = launch_check.check(machine, packages, str(folder / "top.launch"), arguments)
    return {level: "\n".join("%s -> %s" % (entry.what, entry.cure) for entry in found if entry.level == level)
            for level in ("ok", "warning", "problem")}


def test_missing_packages_and_programs_say_what_follows(machine, packages, tmp_path):
    found = examine(machine, packages, tmp_path, '<include file="$(find gone_robot)/a.launch"/><node pkg="gone_node" '
                    'type="a" name="a"/><node pkg="gone_too" type="a" name="b" required="true"/><node '
                    'pkg="robot_state_publisher" type="state_publisher" name="c"/><node pkg="m2wr_sim" type="doctor" '
                    'name="d"/><node pkg="rqt_graph" type="rqt_graph" name="e"/>')
    assert "gone_robot is missing: roslaunch refuses the whole file" in found["problem"]
    assert "gone_node is missing; this node does not start, the others do" in found["warning"]
    assert "gone_too is missing; roslaunch ends" in found["problem"]
    assert 'type="robot_state_publisher"' in found["warning"] and "rosnode list" in found["warning"]
    assert "served by this workspace: m2wr_sim" in found["ok"] and "1 nodes can be started" in found["ok"]


def test_a_description_is_read_as_the_simulator_will(machine, packages, tmp_path):
    (tmp_path / "box.xacro").write_text(ROBOT % "")
    text = '<param name="robot_description" command="xacro %s lib:=$(arg lib)"/><arg name="lib"/>' % (
        tmp_path / "box.xacro")
    text = '<arg name="lib"/>' + text.replace('<arg name="lib"/>', "")
    assert "libgazebo_ros_p3d.so" in examine(machine, packages, tmp_path, text, lib="gazebo_ros_p3d")["ok"]
    found = examine(machine, packages, tmp_path, text, lib="unheard_of")
    assert "plugin libunheard_of.so is not supported" in found["warning"] and not found["problem"]


def test_includes_of_missing_packages_are_listed_together(machine, packages, tmp_path):
    include = '<xacro:include filename="$(find %s)/urdf/a.xacro"/>'
    (tmp_path / "box.xacro").write_text(ROBOT % (include % "gone_a" + '<xacro:include filename="inner.xacro"/>'
                                                 '<xacro:if value="0">%s</xacro:if>' % (include % "gone_c")))
    (tmp_path / "inner.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">%s</robot>' % (include % "gone_b"))
    found = examine(machine, packages, tmp_path, '<param name="r" textfile="%s"/>' % (tmp_path / "box.xacro"))
    assert "package gone_a is missing" in found["problem"] and "package gone_b is missing" in found["problem"]
    assert "gone_c" in found["warning"] and "inner.xacro:1" in found["problem"]


def test_worlds_are_looked_for(machine, packages, tmp_path):
    node = '<node pkg="gazebo_ros" type="gzserver" name="gazebo" args="-e ode %s"/>'
    assert "default" in examine(machine, packages, tmp_path, node % "worlds/empty.world")["ok"]
    assert "world gone.world does not exist" in examine(machine, packages, tmp_path, node % "gone.world")["problem"]


def test_controllers_and_nodelets_name_their_packages(machine, packages, tmp_path):
    (tmp_path / "c.yaml").write_text("arm: {type: unheard_controllers/Arm}")
    found = examine(machine, packages, tmp_path, '<rosparam command="load" file="%s"/><node pkg="nodelet" '
                    'type="nodelet" name="n" args="load gone_nodelets/A manager"/>' % (tmp_path / "c.yaml"))
    assert not found["problem"] and "package gone_nodelets is missing" in found["warning"]


@pytest.mark.parametrize("display, told", [("", True), (":0", False)])
def test_windows_need_a_display(machine, tmp_path, monkeypatch, display, told):
    folder = tmp_path / "rviz"
    folder.mkdir()
    (folder / "package.xml").write_text('<package format="2"><name>rviz</name></package>')
    (folder / "rviz").write_text("")
    (folder / "rviz").chmod(0o755)
    monkeypatch.setattr(machine, "environ", dict(
        machine.environ, DISPLAY=display, WAYLAND_DISPLAY="", ROS_PACKAGE_PATH="%s:%s" % (
            tmp_path, machine.environ.get("ROS_PACKAGE_PATH", ""))))
    found = examine(machine, PackageList(machine), tmp_path, '<node pkg="rviz" type="rviz" name="view"/>')
    assert ("rviz opens a window, and there is no display" in found["warning"]) == told
    assert ("1 nodes can be started" in found["ok"]) != told


NODELETS = """<library path="lib/libbump_nodelets"><class name="bump/Cloud" type="bump::Cloud" base_class_type=
"nodelet::Nodelet"/></library>"""


@pytest.mark.parametrize("kind, built, what, cure", [
    ("bump/Cloud", False, "the library libbump_nodelets.so of nodelet bump/Cloud is not there", "build package bump"),
    ("bump/Cloud", True, "", ""), ("bump/Node", False, "", ""),
    ("bump/Ghost", True, "package bump has no nodelet bump/Ghost", "bump/Cloud")])
def test_nodelets_need_their_library(machine, tmp_path, monkeypatch, kind, built, what, cure):
    folder = tmp_path / "bump"
    folder.mkdir()
    (folder / "package.xml").write_text(
        '<package format="2"><name>bump</name><export><nodelet plugin="${prefix}/n.xml"/>'
        '<m2wr_nodelet type="bump/Node" node="bump"/></export></package>')
    (folder / "n.xml").write_text(NODELETS)
    if built:
        (folder / "libbump_nodelets.so").write_text("")
    monkeypatch.setattr(machine, "environ", dict(machine.environ, ROS_PACKAGE_PATH="%s:%s" % (
        tmp_path, machine.environ.get("ROS_PACKAGE_PATH", ""))))
    found = examine(machine, PackageList(machine), tmp_path, '<node pkg="nodelet" type="nodelet" name="n" '
                    'args="load %s manager"/>' % kind)
    assert (what in found["warning"] and cure in found["warning"]) if what else "1 nodes can be started" in found["ok"]
    assert not what or "can be started" not in found["ok"]


def test_the_command_takes_what_roslaunch_takes(machine, packages, tmp_path, capsys):
    (tmp_path / "top.launch").write_text('<launch><arg name="a"/></launch>')
    path = str(tmp_path / "top.launch")
    assert command.main([path], machine) == 2 and "add a:=VALUE" in capsys.readouterr().out
    assert command.main([path, "a:=1"], machine) == 0
    assert command.main(["m2wr_sim", "rviz.launch"], machine) in (0, 1)
    assert command.main(["gone.launch"], machine) == 2
    (tmp_path / "box.xacro").write_text(ROBOT % "")
    capsys.readouterr()
    assert command.main([str(tmp_path / "box.xacro"), "lib:=gazebo_ros_imu"], machine) == 0
    assert "plugins: libgazebo_ros_imu.so" in capsys.readouterr().out
    path = launch_check.launch_path(packages, ["m2wr_sim", "bug2.launch"])
    assert path.endswith(os.path.join("launch", "bug2.launch"))
    assert launch_check.launch_path(packages, ["m2wr_sim", "gone.launch"]) is None
