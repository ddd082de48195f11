# SPDX-License-Identifier: BSD-3-Clause
"""What a launch file and its includes need, without starting anything."""
from m2wr_tools.doctor import launch_reader
from m2wr_tools.doctor.launch_reader import LaunchReader


def read(folder, text, arguments=None, **files):
    (folder / "top.launch").write_text("<launch>%s</launch>" % text)
    for name, content in files.items():
        path = folder / name.replace("__", ".")
        path.write_text(content if name.endswith("yaml") else "<launch>%s</launch>" % content)
    reader = LaunchReader({"here": str(folder)}.get, {"HOME": "/home/a"})
    return reader.read(str(folder / "top.launch"), arguments or {})


def test_arguments_pass_into_includes(tmp_path):
    found = read(tmp_path, '<arg name="kind" default="a"/><include file="$(find here)/sub.launch">'
                 '<arg name="node" value="$(arg kind)"/></include>', {"kind": "b"},
                 sub__launch='<arg name="node"/><node pkg="here" type="$(arg node)" name="n" args="-x 1"/>')
    node, = found.nodes
    assert (node.package, node.kind, node.words) == ("here", "b", ["-x", "1"]) and len(found.files) == 2
    assert not found.faults and not found.unset


def test_conditions_choose(tmp_path):
    found = read(tmp_path, '<arg name="sim" default="true"/><group if="$(arg sim)"><node pkg="a" type="a" name="a"/>'
                 '</group><node unless="$(arg sim)" pkg="b" type="b" name="b"/><include if="0" file="/gone.launch"/>')
    assert [node.package for node in found.nodes] == ["a"] and not found.absent


def test_all_that_is_missing_is_listed_at_once(tmp_path):
    found = read(tmp_path, '<include file="$(find gone)/a.launch"/><rosparam command="load" '
                 'file="$(find here)/b.yaml"/>'
                 '<arg name="needed"/><node pkg="$(env NOT)" type="c" name="$(arg needed)"/><param name="p" '
                 'command="$(find other)/make it"/>')
    assert set(found.missing) == {"gone", "other"} and found.absent[0][0].endswith("b.yaml")
    assert set(found.unset) == {"argument needed", "environment variable NOT"} and not found.commands


def test_an_argument_that_is_not_known_is_reported_once(tmp_path):
    found = read(tmp_path, '<arg name="a" value="$(eval lambda: 1)"/><param name="p" value="$(arg a)"/>')
    assert len(found.unknown) == 1 and not found.unset


def test_descriptions_and_controllers_are_found(tmp_path):
    (tmp_path / "r.urdf.xacro").write_text("<robot/>")
    found = read(tmp_path, '<param name="robot_description" command="$(find here)/run $(find here)/r.urdf.xacro a:=1"/>'
                 '<rosparam command="load" file="$(find here)/c.yaml"/><param name="p" command="date"/>',
                 c__yaml="base: {type: diff_drive_controller/DiffDriveController, rate: 5}")
    robot, = found.robots
    assert robot.path == str(tmp_path / "r.urdf.xacro") and robot.arguments == {"a": "1"}
    assert found.types == {"base": "diff_drive_controller/DiffDriveController"} and found.commands[0][0] == "date"


def test_endless_includes_end(tmp_path):
    found = read(tmp_path, '<include file="$(find here)/top.launch"/>')
    assert "reading ends here" in found.faults[0][0] and len(found.files) <= launch_reader.DEEPEST + 1
    found = read(tmp_path, '<arg name="n" value="$(eval lambda: 1)"/><include if="$(arg n)" '
                 'file="$(find here)/top.launch"/>')
    assert not found.faults


def test_broken_files_are_faults(tmp_path):
    (tmp_path / "top.launch").write_text("<robot/>")
    found = LaunchReader({}.get, {}).read(str(tmp_path / "top.launch"), {})
    assert "expected <launch>" in found.faults[0][0]
    found = LaunchReader({}.get, {}).read(str(tmp_path / "gone.launch"), {})
    assert "gone.launch" in found.faults[0][0]
    found = read(tmp_path, '<rosparam command="load" file="$(find here)/c.yaml"/>', c__yaml="a: [")
    assert "cannot be read as YAML" in found.faults[0][0]
