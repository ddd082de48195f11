# SPDX-License-Identifier: BSD-3-Clause
"""What simulations of a process share: read once, read again after a change, immutable, and without influence."""
import dataclasses
import hashlib
import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from m2wr_sim.api import Sim, read_robot, read_world
from m2wr_sim.api.shared import Shared
from m2wr_sim.errors import WorldError

BOX = """<model name="{name}"><static>{static}</static><pose>{x} 0 0.25 0 0 0</pose><link name="link">
  <inertial><mass>1</mass><inertia><ixx>0.04</ixx><iyy>0.04</iyy><izz>0.04</izz></inertia></inertial>
  <collision name="box"><geometry><box><size>{size} 0.5 0.5</size></box></geometry></collision></link></model>"""
GROUND = """<model name="ground"><static>true</static><link name="link"><collision name="plane"><geometry><plane>
  <normal>0 0 1</normal></plane></geometry></collision></link></model>"""
YARD = "<sdf version=\"1.6\"><world name=\"yard\">%s%s</world></sdf>" % (GROUND, "".join(
    BOX.format(name="box%d" % index, static="false" if index % 2 else "true", x=1.4 + 0.6 * index, size=0.5)
    for index in range(3)))
COMMANDS = ((0.6, 0.0), (0.5, 0.4), (-0.4, 0.9), (0.6, -0.5), (0.0, 0.0))
CASES = [("world02", (0.0, 8.0, 0.0)), (YARD, (0.0, 0.0, 0.0)), ("moving_05", (0.0, 0.0, 1.0))]


def advance(sim, total, command):
    """Make one step, and add every bit of its result to a hash."""
    result = sim.step(command, 0.4)
    total.update(repr((result.time, result.position, result.orientation, result.contacts)).encode())
    total.update(result.scan.ranges.tobytes())
    total.update(repr(sim.velocity()).encode())


def digest(world, pose, seed):
    total = hashlib.sha256()
    with Sim(world, "m2wr", pose, seed, "now") as sim:
        for command in COMMANDS:
            advance(sim, total, command)
    return total.hexdigest()


def fresh_process(code):
    """Return what a program prints that imports this file."""
    program = "import sys; sys.path.insert(0, %r)\nfrom test_shared import *\n%s" % (os.path.dirname(__file__), code)
    return subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, check=True, timeout=300,
                          universal_newlines=True).stdout.split()


def test_known_worlds_give_the_bits_of_a_fresh_process():
    alone = [fresh_process("print(digest(*CASES[%d], seed=3))" % index)[-1] for index in range(len(CASES))]
    assert len(set(alone)) == len(CASES)
    for _ in range(2):
        assert [digest(*case, seed=3) for case in CASES] == alone
    assert digest(*CASES[0], seed=4) != alone[0]


def test_two_simulations_do_not_influence_each_other():
    alone = [digest(*CASES[1], seed=seed) for seed in (1, 2)]
    sims = [Sim(CASES[1][0], "m2wr", CASES[1][1], seed, "now") for seed in (1, 2)]
    totals = [hashlib.sha256(), hashlib.sha256()]
    for command in COMMANDS:
        for sim, total in zip(sims, totals):
            advance(sim, total, command)
    assert [total.hexdigest() for total in totals] == alone
    sims[0].delete("box0")
    sims[0].set_pose((1.0, 1.0, 0.0), "box1")
    sims[0].close()
    total = hashlib.sha256()
    sims[1].reset()
    assert "box0" in sims[1].models
    for command in COMMANDS:
        advance(sims[1], total, command)
    sims[1].close()
    assert total.hexdigest() == alone[1] == digest(*CASES[1], seed=2)


def test_reset_gives_the_bits_of_a_new_simulation():
    for world, pose in CASES:
        with Sim(world, "m2wr", pose, 7, "now") as sim:
            sim.step((0.6, 0.5), 1.5)
            sim.reset(seed=5)
            total = hashlib.sha256()
            for command in COMMANDS:
                advance(sim, total, command)
            assert total.hexdigest() == digest(world, pose, 5)


def test_reset_moves_an_obstacle_back_that_was_moved():
    with Sim(YARD, "m2wr", seed=1, sensing="now") as sim:
        first = sim.reset().scan.ranges.copy()
        sim.set_pose((0.8, 0.0, 0.25, 0.0), "box0")
        assert (sim.step((0.0, 0.0), 0.1).scan.ranges != first).any()
        np.testing.assert_array_equal(sim.reset().scan.ranges, first)
        assert sim.pose("box0")[0] == (1.4, 0.0, 0.25)


def test_the_same_world_and_robot_are_the_same_records():
    assert read_world("world02") is read_world("world02") is not read_world("world03")
    assert read_robot("m2wr") is read_robot("m2wr") and read_world(YARD) is read_world(YARD)


def write(path, size):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(YARD.replace("0.5 0.5 0.5", "%s 0.5 0.5" % size, 1))


def width(world, name="box0"):
    (model,) = [model for model in read_world(str(world)).models if model.name == name]
    return model.links[0].collisions[0].geometry.size[0]


def test_a_world_file_that_changed_is_read_again(tmp_path):
    path = tmp_path / "yard.world"
    write(path, "0.25")
    assert width(path) == 0.25
    write(path, "0.125")
    assert width(path) == 0.125
    path.write_text("<sdf")
    with pytest.raises(WorldError):
        read_world(str(path))
    path.unlink()
    with pytest.raises(WorldError, match="no such file"):
        read_world(str(path))
    write(path, "0.75")
    assert width(path) == 0.75


def test_an_included_model_that_changed_is_read_again(tmp_path, monkeypatch):
    first, second = tmp_path / "first", tmp_path / "second"
    monkeypatch.setenv("GAZEBO_MODEL_PATH", "%s:%s" % (first, second))

    def model(folder, size):
        (folder / "crate").mkdir(parents=True, exist_ok=True)
        text = BOX.format(name="crate", static="true", x=1, size=size)
        (folder / "crate" / "model.sdf").write_text("<sdf version=\"1.6\">%s</sdf>" % text)

    world = "<sdf version=\"1.6\"><world name=\"w\"><include><uri>model://crate</uri></include></world></sdf>"
    model(second, "0.25")
    assert width(world, "crate") == 0.25
    model(second, "0.125")
    assert width(world, "crate") == 0.125
    model(first, "0.75")                # it is found first, and was not there before
    assert width(world, "crate") == 0.75


ROBOT = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="size.xacro"/>
  <xacro:property name="more" value="${xacro.load_yaml('more.yaml')}"/>
  <link name="base"><collision><geometry><box size="${size} ${more['width']} 1"/></geometry></collision>
  <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>"""


def test_an_included_xacro_file_that_changed_is_read_again(tmp_path):
    robot, size, more = tmp_path / "r.xacro", tmp_path / "size.xacro", tmp_path / "more.yaml"

    def sizes():
        return read_robot(str(robot)).links[0].collisions[0].geometry.size[:2]

    text = "<robot xmlns:xacro=\"http://www.ros.org/wiki/xacro\"><xacro:property name=\"size\" value=\"%s\"/></robot>"
    robot.write_text(ROBOT)
    size.write_text(text % "2")
    more.write_text("width: 3")
    assert sizes() == (2.0, 3.0)
    size.write_text(text % "2.5")
    assert sizes() == (2.5, 3.0)
    more.write_text("width: 3.25")
    assert sizes() == (2.5, 3.25)


def test_xacro_arguments_give_robots_of_their_own(tmp_path):
    robot = tmp_path / "r.xacro"
    robot.write_text("""<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="size" default="1"/>
      <link name="base"><collision><geometry><box size="$(arg size) 1 1"/></geometry></collision>
      <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
      </robot>""")
    found = [read_robot(str(robot), arguments).links[0].collisions[0].geometry.size[0]
             for arguments in ({"size": 2}, {"size": 3}, None, {"size": 2})]
    assert found == [2.0, 3.0, 1.0, 2.0]


def immutable(value):
    """Return whether a record, with all that it holds, cannot be changed."""
    if isinstance(value, np.ndarray):
        return not value.flags.writeable
    if dataclasses.is_dataclass(value):
        return type(value).__dataclass_params__.frozen and all(
            immutable(getattr(value, field.name)) for field in dataclasses.fields(value))
    if isinstance(value, tuple):
        return all(map(immutable, value))
    return value is None or isinstance(value, (bool, int, float, str, bytes))


def test_shared_records_cannot_be_changed():
    for record in [read_world(name) for name in ("world02", "moving_20", "shapes")] + [read_robot("m2wr")]:
        assert immutable(record)
    assert not immutable((1.0, [2.0]))


def test_the_heaviest_and_the_most_records_are_bounded():
    shared = Shared(len, 10, most=3)
    for key in "abc":
        shared.get(key, lambda: "xxx")
    shared.get("a", lambda: pytest.fail("is known"))
    shared.get("d", lambda: "x")
    assert len(shared) == 3
    shared.get("a", lambda: pytest.fail("was used last but one"))
    assert shared.get("b", lambda: "new") == "new"
    shared.get("e", lambda: "x" * 11)           # too heavy to be kept
    assert shared.get("e", lambda: "again") == "again"
    shared.clear()
    assert len(shared) == 0


def test_errors_are_not_kept():
    shared = Shared(len, 10)
    with pytest.raises(ZeroDivisionError):
        shared.get("a", lambda: str(1 // 0))
    assert shared.get("a", lambda: "fine") == "fine"


def test_threads_may_read_at_the_same_time():
    found = []
    threads = [threading.Thread(target=lambda: found.append(read_world("world01"))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert len(found) == 8 and all(world == found[0] for world in found)
