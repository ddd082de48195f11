# SPDX-License-Identifier: BSD-3-Clause
"""Each exercise: what a student starts from is not yet right, a solution is, and typical mistakes are named."""
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from course_checks import check
from m2wr_course.command import EXERCISES, main
from m2wr_sim.api.loading import package_folder, read_world
from m2wr_tools.map_comparison.agreement import INSIDE, LASER_HEIGHT, WALL, Truth

URDF = Path(package_folder("m2wr_description")) / "urdf"
BACK = """
  <joint name="joint_back" type="fixed"><origin xyz="-0.25 0 0.1" rpy="0 0 3.14159"/>
    <parent link="link_chassis"/><child link="sensor_back"/></joint>
  <link name="sensor_back"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0"
    iyz="0"/></inertial></link>
  <gazebo reference="sensor_back"><sensor type="ray" name="back"><update_rate>20</update_rate><ray><scan><horizontal>
    <samples>360</samples><min_angle>-1.5</min_angle><max_angle>1.5</max_angle></horizontal></scan><range><min>0.1</min>
    <max>10</max></range></ray><plugin name="b" filename="libgazebo_ros_laser.so"><topicName>/m2wr/back/scan</topicName>
    <frameName>sensor_back</frameName></plugin></sensor></gazebo>
"""
BOX = ('<model name="%s"><static>1</static><pose>0 %g 0.5 0 0 0</pose><link name="l"><collision name="c"><geometry>'
       "<box><size>2 0.3 1</size></box></geometry></collision></link></model>")
NEAREST = """
import math
def nearest(ranges, angle_min, angle_increment):
    found = [(r, angle_min + i * angle_increment) for i, r in enumerate(ranges) if math.isfinite(r)]
    return min(found) if found else None
"""


def test_the_command_loads_only_the_check_that_is_asked_for():
    done = subprocess.run([sys.executable, "-c", "import sys; import m2wr_course.command as command; "
                           "print(*sys.modules); command.check_of(4); print(*sys.modules)"],
                          stdout=subprocess.PIPE, universal_newlines=True, check=True, timeout=120)
    heavy = {"numpy", "numba", "PIL", "lxml", "yaml"}
    for line in done.stdout.splitlines():
        assert not set(line.split()) & heavy


@pytest.fixture
def robot(tmp_path):
    """The robot's files, to be edited; call with (file, old, new) to change one and get the robot's path."""
    folder = tmp_path / "my_robot"
    shutil.copytree(str(URDF), str(folder))

    def change(*edits):
        for name, old, new in (("m2wr.xacro", "$(find m2wr_description)/urdf/", ""),) + edits:
            text = (folder / name).read_text(encoding="utf-8")
            assert old in text
            (folder / name).write_text(text.replace(old, new), encoding="utf-8")
        return str(folder / "m2wr.xacro")

    return change


WIDER = (("m2wr.xacro", "-0.05 0.20 0", "-0.05 0.30 0"), ("m2wr.xacro", "-0.05 -0.20 0", "-0.05 -0.30 0"))


def test_a_wider_robot_is_done_when_the_plugin_knows_it(robot, capsys):
    path = robot(*WIDER, ("m2wr.gazebo", "<wheelSeparation>0.4", "<wheelSeparation>0.6"))
    code, said = check(1, path, capsys)
    assert code == 0 and "exercise 1: done" in said.out, said.out


def test_a_separation_that_was_forgotten_shows_in_the_turn(robot, capsys):
    code, said = check(1, robot(*WIDER), capsys)
    assert code == 1 and "it turns with 0.33" in said.out and "<wheelSeparation>" in said.out


def test_the_robot_as_it_is_is_no_solution_of_the_first(robot, capsys):
    code, said = check(1, robot(), capsys)
    assert code == 1 and "the wheels are 0.40 m apart" in said.out and said.out.count("not yet  ") == 1


def test_bigger_wheels_tilt_it(robot, capsys):
    code, said = check(1, robot(*WIDER, ("macros.xacro", 'radius="0.1"', 'radius="0.2"')), capsys)
    assert code == 1 and "degrees from level" in said.out.split("not yet")[1]


def test_tidier_files_of_the_same_robot_are_done(robot, capsys):
    path = robot(("macros.xacro", 'radius="0.1"', 'radius="${wheel_radius}"'),
                 ("macros.xacro", "<xacro:macro name=\"link_wheel\"",
                  '<xacro:property name="wheel_radius" value="0.10"/><xacro:macro name="link_wheel"'))
    code, said = check(2, path, capsys)
    assert code == 0, said.out


def test_another_robot_is_told_by_its_part(robot, capsys):
    code, said = check(2, robot(("macros.xacro", 'radius="0.1"', 'radius="0.11"')), capsys)
    assert code == 1 and '<link name="link_left_wheel"> differs from m2wr\'s' in said.out and "used: none" in said.out


def test_a_laser_behind_is_done(robot, capsys):
    code, said = check(3, robot(("m2wr.xacro", "</robot>", BACK + "</robot>")), capsys)
    assert code == 0, said.out


def test_a_laser_that_looks_ahead_does_not_see_the_wall_behind(robot, capsys):
    path = robot(("m2wr.xacro", "</robot>", BACK.replace("3.14159", "0") + "</robot>"))
    code, said = check(3, path, capsys)
    assert code == 1 and "turns the laser round" in said.out and "1 of 4 not yet" in said.out


def test_one_laser_is_not_two(robot, capsys):
    code, said = check(3, robot(), capsys)
    assert code == 1 and "the robot has 1 laser\n" in said.out


def test_a_careful_nearest_is_done(tmp_path, capsys):
    (tmp_path / "mine.py").write_text(NEAREST)
    assert check(4, tmp_path / "mine.py", capsys)[0] == 0


def test_a_careless_nearest_fails_where_it_should(tmp_path, capsys):
    (tmp_path / "mine.py").write_text("def nearest(r, a, d):\n    m = min(r)\n    return m, a + r.index(m) * d\n")
    code, said = check(4, tmp_path / "mine.py", capsys)
    assert code == 1 and "no beams at all: it raises ValueError" in said.out and "ok       one thing ahead" in said.out


def world(path, *boxes):
    models = "".join(BOX % ("box%d" % number, y) for number, y in enumerate(boxes))
    path.write_text('<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include>'
                    "%s</world></sdf>" % models)
    return path


def test_two_boxes_on_the_line_are_done(tmp_path, capsys):
    code, said = check(5, world(tmp_path / "w.world", 4.5, 0.0), capsys)
    assert code == 0, said.out


def test_one_box_is_not_enough(tmp_path, capsys):
    code, said = check(5, world(tmp_path / "w.world", 2.0), capsys)
    assert code == 1 and "meets a wall 1 times" in said.out


@pytest.mark.parametrize("number", sorted(EXERCISES))
def test_files_that_cannot_be_tried_end_in_a_sentence(number, tmp_path, capsys):
    code, said = check(number, tmp_path / "none", capsys)
    assert code == 2 and "there is no file" in said.err
    (tmp_path / "broken").write_text("<robot name=")
    code, said = check(number, tmp_path / "broken", capsys)
    # a Python file shows the line that cannot be read below the sentence
    assert code == 2 and said.err.count("\n") == (2 if number in (4, 9) else 1) and "broken" in said.err


def test_a_part_that_differs_is_named_as_it_stands_in_the_file(robot, capsys):
    path = robot(("m2wr.gazebo", "<wheelSeparation>0.4", "<wheelSeparation>0.5"),
                 ("m2wr.xacro", '<mass value="5"/>', '<mass value="6"/>'))
    code, said = check(2, path, capsys)
    assert code == 1 and '<gazebo> with <plugin name="differential_drive_controller"> differs' in said.out
    assert '<link name="link_chassis"> differs' in said.out


def test_a_syntax_error_is_told_with_its_line(tmp_path, capsys):
    path = tmp_path / "mine.py"
    path.write_text("import math\ndef nearest(ranges, angle_min, angle_increment)\n    return None\n")
    code, said = check(4, path, capsys)
    assert code == 2 and "mine.py, line 2: syntax error" in said.err
    assert "def nearest(ranges, angle_min, angle_increment)" in said.err


def make_map(folder, shape=(400, 400), bend=0.0):
    """Write the map of world02 that a perfect mapper would draw, turned by an angle [rad]; returns the YAML file."""
    truth = Truth(read_world("world02"), LASER_HEIGHT, (0.0, 0.0, bend))
    drawn = truth.drawn(shape, 0.05, np.array((-0.025 * shape[1], -0.025 * shape[0])))
    grey = np.select([drawn == WALL, drawn == INSIDE], [0, 205], 254).astype(np.uint8)
    Image.fromarray(grey[::-1]).save(str(folder / "plan.pgm"))
    (folder / "plan.yaml").write_text("image: plan.pgm\nresolution: 0.05\norigin: [%g, %g, 0.0]\n" % (
        -0.025 * shape[1], -0.025 * shape[0]))
    return folder / "plan.yaml"


def test_a_good_map_is_done(tmp_path, capsys):
    code, said = check(6, make_map(tmp_path), capsys)
    assert code == 0, said.out


def test_a_map_that_bends_or_is_small_is_not(tmp_path, capsys):
    code, said = check(6, make_map(tmp_path, bend=0.1), capsys)
    assert code == 1 and "not yet" in said.out and "particles" in said.out
    code, said = check(6, make_map(tmp_path, (100, 100)), capsys)
    assert code == 1 and "drive farther" in said.out


def test_what_is_no_map_is_told(tmp_path, capsys):
    (tmp_path / "plan.yaml").write_text("image: plan.pgm\n")
    code, said = check(6, tmp_path / "plan.yaml", capsys)
    assert code == 2 and "expected the .yaml file that map_saver writes" in said.err


def weights(path, **given):
    path.write_text("criteria:\n" + "".join("  %s: {%s}\n" % entry for entry in given.items()))
    return path


def test_weights_that_keep_the_distance_are_done(tmp_path, capsys):
    code, said = check(7, weights(tmp_path / "w.yaml", clearance="weight: 20.0, wanted: 0.7"), capsys)
    assert code == 0, said.out


def test_the_weights_as_they_are_give_the_narrow_path(tmp_path, capsys):
    shutil.copy(str(Path(package_folder("m2wr_sim")) / "config" / "best_path.yaml"), str(tmp_path / "w.yaml"))
    code, said = check(7, tmp_path / "w.yaml", capsys)
    assert code == 1 and "1 of 3 not yet" in said.out and "short" in said.out.split("not yet")[1]


def test_a_weight_that_is_spelt_wrong_is_named(tmp_path, capsys):
    code, said = check(7, weights(tmp_path / "w.yaml", clearance="wieght: 20.0"), capsys)
    assert code == 1 and "did you mean weight?" in said.out


def report(tmp_path, **changes):
    found = {"seed": 100, "settings": {"roughness": 1.5}, "robots": [{"robot": "robot1", "end": ""}],
             "parcels": [{"parcel": "parcel%d" % number, "way_exists": number < 5,
                          "delivered": 9.0 if number < 5 else None} for number in range(1, 6)]}
    path = tmp_path / "delivery.json"
    path.write_text(json.dumps(dict(found, **changes)))
    return str(path)


def test_a_delivery_on_rough_ground_is_done(tmp_path):
    assert main(["10", report(tmp_path)]) == 0


@pytest.mark.parametrize("changes, words", [
    ({"seed": 5}, "seed from 100 on"), ({"settings": {"roughness": 1.0}}, "--roughness 1.5"),
    ({"robots": [{"robot": "robot1", "end": "battery flat"}]}, "robot1 did not come back"),
    ({"parcels": [{"parcel": "parcel1", "way_exists": True, "delivered": None}]}, "why parcel1 was not delivered")])
def test_a_delivery_that_is_not_yet_right(tmp_path, capsys, changes, words):
    assert main(["10", report(tmp_path, **changes)]) == 1
    assert words in capsys.readouterr().out


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"settings": 1}',
                                  '{"seed": 1, "settings": {"roughness": 1}, "parcels": [1], "robots": []}'])
def test_what_is_no_report_of_a_delivery_is_told(tmp_path, capsys, text):
    path = tmp_path / "delivery.json"
    path.write_text(text)
    assert main(["10", str(path)]) == 2 and "no report" in capsys.readouterr().err
