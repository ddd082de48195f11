# SPDX-License-Identifier: BSD-3-Clause
"""The library: worlds and robots in, numbers out; the same ones as the node's, and the same ones every time."""
import copy
import hashlib
import logging
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from m2wr_sim.api import Sim, read_robot, read_world
from m2wr_sim.errors import ModelError, NotFoundError, ParameterError, WorldError
from m2wr_sim.physics.engine import settings_from_physics
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.runtime.once_logger import OnceLogger
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

BOX = """<model name="{name}"><static>{static}</static><pose>{x} {y} 0.25 0 0 0</pose><link name="link">
  <inertial><mass>1</mass><inertia><ixx>0.04</ixx><iyy>0.04</iyy><izz>0.04</izz></inertia></inertial>
  <collision name="box"><geometry><box><size>0.5 0.5 0.5</size></box></geometry></collision></link></model>"""
GROUND = """<model name="ground"><static>true</static><link name="link"><collision name="plane"><geometry><plane>
  <normal>0 0 1</normal></plane></geometry></collision></link></model>"""
YARD = "<sdf version=\"1.6\"><world name=\"yard\">%s%s</world></sdf>" % (GROUND, "".join(
    BOX.format(name="box%d" % index, static="false" if index % 2 else "true", x=1.2 * index - 2.0, y=1.5)
    for index in range(4)))
HEAP = "<sdf version=\"1.6\"><world name=\"heap\">%s%s</world></sdf>" % (GROUND, "".join(
    BOX.format(name="box%d" % index, static="false", x=1.0 + 0.45 * (index % 3), y=0.45 * (index // 3) - 0.4)
    for index in range(6)))
COMMANDS = [((0.6, 0.0), (0.5, 0.4), (-0.4, 0.9)), ((0.2, 1.0), (0.6, -0.3), (0.0, 0.0)),
            ((-0.5, -0.2), (0.6, 0.1), (0.7, 0.0))]


def many_robots(seed, engine="auto"):
    """Return a simulation of three robots that get into one another's way and push boxes."""
    sim = Sim(YARD, seed=seed, engine=engine)
    robot = read_robot("m2wr")
    for index, pose in enumerate(((-0.6, 0.3, 1.5), (0.6, 0.0, 2.2), (0.0, -1.2, 1.57))):
        sim.spawn(robot, pose, "robot%d" % index)
    return sim


def heap(seed, engine):
    """Return a simulation in which boxes and robots overlap from the start, so that the order of contacts tells."""
    sim = Sim(HEAP, seed=seed, engine=engine)
    robot = read_robot("m2wr")
    for index in range(3):
        sim.spawn(robot, (0.25 + 0.1 * index, 0.5 * index - 0.6, 0.3 * index), "robot%d" % index)
    return sim


def digest(sim, rounds=6, seconds=0.4):
    """Run a simulation and return a hash over every bit of what it tells."""
    total = hashlib.sha256()
    for index in range(rounds):
        result = sim.step(COMMANDS[index % len(COMMANDS)][:len(sim.robots)], seconds)
        total.update(repr((result.time, [(one.position, one.orientation, one.odometry, one.contacts)
                                         for one in result.robots.values()])).encode())
        for one in result.robots.values():
            total.update(one.scan.ranges.tobytes())
        total.update(repr([sim.pose(name) for name in sim.models]).encode())
        total.update(repr([sim.joint_positions(name) for name in sim.robots]).encode())
    return total.hexdigest()


@pytest.fixture(scope="module")
def m2wr_record():
    """Return the robot, read once."""
    return read_robot("m2wr")


@pytest.fixture
def sim(m2wr_record):
    """Return a robot at the origin of the empty world."""
    with Sim("empty", m2wr_record, seed=5) as made:
        yield made


# ---- the node's numbers ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["auto", "pyode"])
def test_odometry_and_scans_are_those_of_the_node(m2wr_record, engine):
    from geometry_msgs.msg import Twist
    world = read_world("world02")
    commands = [(0.5, 0.3), (0.3, -0.8), (0.0, 0.7), (0.6, 0.0)]
    settings = settings_from_physics(world.physics, 1000000)
    node = Simulator(make_engine("auto", settings), RayScene(), LocalPorts(copy.deepcopy),
                     SimConfig(seed=11, wheel_convention="rep103"))
    try:
        node.load_world(world)
        node.spawn(m2wr_record, ((0.5, 8.0, 0.1), (0.0, 0.0, math.sin(0.2), math.cos(0.2))), namespace="/")
        for index, (linear, angular) in enumerate(commands):
            message = Twist()
            message.linear.x, message.angular.z = linear, angular
            node.ports.send("/cmd_vel", message)
            while node.now_ns < 400000000 * (index + 1):
                node.advance(400000000 * (index + 1))
        expected_odometry = [(message.header.stamp, message.pose.pose, message.twist.twist)
                             for message in node.ports.topics["/odom"].messages]
        expected_scans = [(message.header.stamp, message.ranges)
                          for message in node.ports.topics["/m2wr/laser/scan"].messages]
    finally:
        node.close()
    assert len(expected_odometry) == 31 and len(expected_scans) == 32

    pose = ((0.5, 8.0, 0.1), (0.0, 0.0, math.sin(0.2), math.cos(0.2)))
    with Sim(world, m2wr_record, pose, seed=11, engine=engine) as sim:
        for again in range(2):                  # as new, and after a reset
            odometry, scans = [], []
            sim.drive().callbacks[:] = [odometry.append]
            sim.lasers()[0].callbacks[:] = [scans.append]
            for command in commands:
                sim.step(command, 0.4)
            assert len(odometry) == len(expected_odometry) and len(scans) == len(expected_scans)
            for mine, (stamp, place, twist) in zip(odometry, expected_odometry):
                assert mine.time == stamp / 1e9
                assert mine.position == (place.position.x, place.position.y, place.position.z)
                assert mine.orientation == (place.orientation.x, place.orientation.y, place.orientation.z,
                                            place.orientation.w)
                assert (mine.linear_x, mine.linear_y, mine.angular_z) == (twist.linear.x, twist.linear.y,
                                                                          twist.angular.z)
            for mine, (stamp, ranges) in zip(scans, expected_scans):
                assert mine.time == stamp / 1e9 and np.array_equal(mine.ranges, ranges)
            sim.reset(11)


def test_first_measurements_come_when_the_node_sends_them(sim):
    first = sim.step(None, 0.05)
    assert first.odometry is None and first.scan.time == 0.001
    second = sim.step(None, 0.001)
    assert second.odometry.time == 0.051 and second.scan.time == 0.051


# ---- the same numbers every time -------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ["auto", "pyode"])
def test_a_reset_repeats_many_robots_to_the_last_bit(engine):
    with many_robots(3, engine) as sim:
        first = digest(sim)
        assert any(sim.contact_count(name) for name in sim.robots), "no contact: the scene tests too little"
        sim.reset(3)
        assert digest(sim) == first
        sim.reset(4)
        other = digest(sim)
        assert other != first
        sim.reset(3)
        assert digest(sim) == first
    with many_robots(4, engine) as sim:
        assert digest(sim) == other


@pytest.mark.parametrize("engine", ["auto", "pyode"])
def test_a_reset_repeats_a_heap_to_the_last_bit(engine):
    with heap(1, engine) as sim:
        first = digest(sim, 2, 0.06)
        sim.reset(1)
        assert digest(sim, 2, 0.06) == first


def test_engines_agree_to_the_last_bit():
    found = []
    for engine in ("auto", "pyode"):
        with many_robots(6, engine) as sim:
            found.append(digest(sim, 3))
    assert found[0] == found[1]


def test_steps_may_be_cut_in_any_way(sim):
    sim.step((0.5, 0.4), 1.3)
    expected = sim.pose(), sim.observe().scan.ranges.tolist()
    sim.reset(5)
    sim.step((0.5, 0.4), 0.1)
    for duration in (0.001, 0.049, 0.33, 0.07, 0.75):
        sim.step(None, duration)
    assert (sim.pose(), sim.observe().scan.ranges.tolist()) == expected


def test_another_process_gets_the_same_numbers():
    with many_robots(9) as sim:
        expected = digest(sim, 3)
    code = "import test_api_sim as t\nwith t.many_robots(9) as sim:\n    print(t.digest(sim, 3))\n"
    environment = dict(os.environ, PYTHONHASHSEED="77", PYTHONPATH=os.pathsep.join(
        [str(Path(__file__).parent)] + [entry for entry in sys.path if entry]))
    done = subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, check=True)
    assert done.stdout.decode().split()[-1] == expected


def test_simulations_side_by_side_do_not_disturb_one_another():
    with many_robots(3) as alone:
        expected = digest(alone, 2)
    with many_robots(3) as one, many_robots(8) as two:
        two.step(COMMANDS[0], 0.3)
        assert digest(one, 2) == expected
        two.step(COMMANDS[1], 0.3)
        one.reset(3)
        assert digest(one, 2) == expected


def test_a_world_with_a_stored_state_is_reset_to_it(m2wr_record):
    state = ("<state world_name=\"yard\"><sim_time>2 0</sim_time>"
             "<model name=\"box1\"><pose>3 3 0.5 0 0 0</pose></model></state></world>")
    with Sim(YARD.replace("</world>", state), m2wr_record, (0.0, 0.0, 0.0), seed=1) as sim:
        assert sim.time == 2.0 and sim.pose("box1")[0] == (3.0, 3.0, 0.5)
        first = digest(sim, 2)
        assert sim.reset(1).time == 2.0
        assert digest(sim, 2) == first


# ---- driving and sensing ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [(0.5, 0.0), (0.0, 0.5), (0.4, -0.6)])
def test_velocity_follows_the_command_and_left_is_positive(sim, command):
    result = sim.step(command, 2.0)
    assert result.odometry.linear_x == pytest.approx(command[0], abs=2e-3)
    assert result.odometry.angular_z == pytest.approx(command[1], abs=2e-3)
    assert sim.velocity()[1][2] == pytest.approx(command[1], abs=2e-3)
    if command[1]:
        assert math.copysign(1.0, result.pose[2]) == math.copysign(1.0, command[1])


def test_a_command_holds_and_a_non_finite_one_is_refused(sim, caplog):
    sim.step((0.5, 0.0), 1.0)
    with caplog.at_level(logging.WARNING):
        result = sim.step((math.nan, 0.0), 1.0)
    assert "refused a velocity command" in caplog.text
    assert result.odometry.linear_x == pytest.approx(0.5, abs=2e-3)


def test_command_timeout_stops_the_robot(m2wr_record):
    with Sim("empty", m2wr_record, command_timeout=0.5) as sim:
        assert sim.step((0.5, 0.0), 0.5).odometry.linear_x == pytest.approx(0.5, abs=0.01)
        assert abs(sim.step(None, 1.0).odometry.linear_x) < 1e-3


def test_sensing_now_measures_at_the_end_of_each_step(m2wr_record):
    with Sim("world02", m2wr_record, (0.0, 8.0, 0.0), sensing="now") as sim:
        scans = []
        sim.lasers()[0].callbacks.append(scans.append)
        for result in (sim.reset(), sim.step((0.3, 0.0), 0.13), sim.step(None, 0.02)):
            assert result.scan.time == result.odometry.time == result.time
        assert result.odometry.position == result.position
        assert not scans, "the laser measured by itself as well"


@pytest.mark.parametrize("world", ["moving_20", "world02"])
@pytest.mark.parametrize("timeout", [0.0, 0.12])
def test_code_between_physics_steps_changes_no_number(m2wr_record, world, timeout):
    """With a callback all plugins are asked before each physics step, without one only when they may act."""
    seen = []
    for callbacks in ([], [lambda _: None]):
        with Sim(world, m2wr_record, seed=3, sensing="now", step=0.02, command_timeout=timeout) as sim:
            sim.drive().callbacks.extend(callbacks)
            for turn in range(20):
                result = sim.step((0.5, 0.1 * (turn % 7 - 3)) if turn % 4 else None, 0.1 + 0.02 * (turn % 3))
                seen.append((result.time, result.position, result.scan.ranges.tobytes(), result.contacts,
                             tuple(tuple(sim.simulator.models[name].pose(sim.simulator.engine)[0])
                                   for name in sorted(sim.simulator.models))))
    assert seen[:20] == seen[20:] and seen[19][1] != seen[0][1]


def test_sensing_off_takes_no_scans(m2wr_record):
    with Sim("empty", m2wr_record, sensing="off") as sim:
        result = sim.step(None, 0.2)
        assert result.scan is None and result.odometry is not None


def test_scans_stay_as_they_are_and_see_the_wall_at_its_distance(m2wr_record):
    with Sim(YARD, m2wr_record, (0.0, -1.0, math.pi / 2)) as sim:
        first = sim.step(None, 0.3).scan
        kept = first.ranges.copy()
        sim.step((0.0, 1.0), 1.0)
        assert np.array_equal(first.ranges, kept)
        assert first.ranges.dtype == np.float32 and first.ranges.shape == first.angles.shape == (720,)
        # laser 0.15 m ahead of the centre, faces of the boxes at y = 1.25: box1 spans x -1.05 to -0.55
        beam = int(np.argmin(np.abs(first.angles - math.atan2(0.8, 2.1))))
        assert first.ranges[beam] == pytest.approx(math.hypot(0.8, 2.1), abs=0.06)
        assert "array" not in repr(first)


def test_contacts_have_time_place_names_until_reset(m2wr_record):
    with Sim(YARD, m2wr_record, (-2.0, 0.2, math.pi / 2)) as sim:
        found = [contact for _ in range(60) for contact in sim.step((0.5, 0.0), 0.05).contacts]
        assert len(found) >= 1 and sim.contact_count() >= 1
        first = found[0]
        assert {first.first.split("::")[0], first.second.split("::")[0]} == {"m2wr", "box0"}
        assert first.position[1] == pytest.approx(1.25, abs=0.02) and 0.0 <= first.depth < 0.005
        assert first.concerns("m2wr") and first.concerns("box0") and not first.concerns("box1")
        # 0.65 m to go from the tip of the chassis at 0.5 m/s, the first tick at 51 ms
        assert 1.2 < first.time < 1.6
        sim.reset()                             # while it is in contact
        assert sim.contact_count() == 0
        again = [contact for _ in range(60) for contact in sim.step((0.5, 0.0), 0.05).contacts]
        assert again == found


def test_robots_see_and_push_one_another(m2wr_record):
    with Sim("empty", seed=1) as sim:
        sim.spawn(m2wr_record, (0.0, 0.0, 0.0), "left")
        sim.spawn(m2wr_record, (2.0, 0.0, math.pi), "right")
        result = sim.step(None, 0.2)
        assert list(result.robots) == ["left", "right"] == list(sim.robots)
        # from the laser at x = 0.15 m to the near side of the other's, a cylinder of 0.05 m around x = 1.85 m
        assert result["left"].scan.ranges[355:365].min() == pytest.approx(1.65, abs=0.05)
        assert result["left"].scan.ranges[350:370].max() == math.inf
        with pytest.raises(AttributeError, match="2 robots \\(left, right\\)"):
            result.pose
        contacts = []
        for _ in range(40):
            result = sim.step([(0.4, 0.0), (0.4, 0.0)], 0.1)
            contacts += result["left"].contacts
        assert contacts and contacts[0].concerns("right") and sim.contact_count("right") == sim.contact_count("left")


def test_spawn_place_delete(m2wr_record):
    with Sim("empty") as sim:
        assert sim.spawn(m2wr_record, (1.0, 2.0, 0.5)) == "m2wr"
        sim.spawn(YARD.replace("<world name=\"yard\">%s" % GROUND, "").split("</model>")[0] + "</model></sdf>",
                  (3.0, 0.0, 0.25, 0.0), "crate")
        assert sim.models == ("ground_plane", "m2wr", "crate")
        with pytest.raises(ModelError, match="already in the world"):
            sim.spawn(m2wr_record)
        sim.set_pose((4.0, 4.0, 1.0), "m2wr")
        assert sim.pose("m2wr")[0] == pytest.approx((4.0, 4.0, 0.1))
        sim.delete("crate")
        assert sim.robots == ("m2wr",)
        assert sim.reset().pose == pytest.approx((1.0, 2.0, 0.5))
        assert sim.reset(poses=(0.0, -1.0, 0.25)).pose == pytest.approx((0.0, -1.0, 0.25))
        sim.step((0.5, 0.0), 0.3)
        assert sim.reset(poses={"m2wr": (0.0, -2.0, 0.0)}).pose == (0.0, -2.0, 0.0)


def test_clearance_is_the_distance_to_what_is_nearest(m2wr_record):
    with Sim(YARD, m2wr_record, (-2.0, -1.0, 0.0)) as sim:
        assert sim.clearance(-2.0, 0.0, ignore="m2wr") == pytest.approx(1.25, rel=1e-3)
        assert sim.clearance(-2.0, 0.0, height=0.07) < 1.0       # the robot
        assert sim.clearance(20.0, 0.0, reach=3.0) == 3.0


def test_second_robot_of_a_record_is_not_warned_of_again(m2wr_record, caplog, monkeypatch):
    monkeypatch.setattr("m2wr_sim.api.sim._ONCE_LOGGER", OnceLogger())
    with caplog.at_level(logging.WARNING), Sim("empty", wheel_convention="noetic") as sim:
        sim.spawn(m2wr_record, name="one")
        said = len(caplog.records)
        sim.spawn(m2wr_record, (2.0, 0.0, 0.0), "two")
        assert said > 0 and len(caplog.records) == said


# ---- loading ---------------------------------------------------------------------------------------------------------


def test_worlds_and_robots_by_name_path_text_and_record(tmp_path):
    by_name = read_world("world01")
    assert read_world("world01.world") == by_name and read_world(by_name) is by_name
    path = tmp_path / "yard.world"
    path.write_text(YARD)
    assert [model.name for model in read_world(path).models] == [model.name for model in read_world(YARD).models]
    robot = read_robot("m2wr")
    assert robot.name == "m2wr" and read_robot(robot) is robot
    swapped = read_robot("m2wr", {"swap_wheel_joints": "true"})
    assert robot.plugins[0].find("leftJoint") == swapped.plugins[0].find("rightJoint")


def test_the_text_of_an_sdf_robot_may_speak_of_robots():
    text = ('<sdf version="1.6"><model name="cart"><link name="base"/><plugin name="p" filename="libp.so">'
            '<robotNamespace>/</robotNamespace></plugin></model></sdf>')
    assert read_robot(text).name == "cart"


def test_bad_worlds_and_robots_are_named(tmp_path):
    with pytest.raises(WorldError, match="nowhere.*expected a path or one of empty, "):
        read_world("nowhere")
    with pytest.raises(ModelError, match="no_such.urdf.*expected a readable file"):
        read_robot(tmp_path / "no_such.urdf")
    with pytest.raises(ModelError, match="holds 4 models; expected one"):
        read_robot(YARD.replace(GROUND, ""))


# ---- misuse ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options, error", [
    ({"sensing": "often"}, ParameterError), ({"seed": -1}, ParameterError), ({"seed": math.nan}, ParameterError),
    ({"step": 0.0}, WorldError), ({"step": math.nan}, WorldError), ({"step": 0.2}, WorldError),
    ({"engine": "warp"}, ParameterError), ({"solver": "slow"}, ParameterError),
    ({"wheel_convention": "mirror"}, ParameterError), ({"command_timeout": -1.0}, ParameterError),
    ({"pose": (0.0, math.nan, 0.0)}, ValueError), ({"pose": (0.0,)}, ValueError)])
def test_bad_options_are_refused(m2wr_record, options, error):
    with pytest.raises(error, match="expected"):
        Sim("empty", m2wr_record, **options)


@pytest.mark.parametrize("command, duration, error, text", [
    (None, 0.0, ValueError, "at least one physics step of 0.001 s"), (None, math.inf, ValueError, "expected at least"),
    (None, math.nan, ValueError, "expected at least"), ([(0.1, 0.0), (0.1, 0.0)], 0.1, ValueError, "for 1 robots"),
    ({"ghost": (0.1, 0.0)}, 0.1, NotFoundError, "no robot \"ghost\"; robots: m2wr")])
def test_bad_steps_are_refused(sim, command, duration, error, text):
    with pytest.raises(error, match=text):
        sim.step(command, duration)
    assert sim.time == 0.0


def test_a_model_without_a_drive_cannot_be_commanded():
    with Sim(YARD) as sim:
        sim.spawn(BOX.join(["<sdf version=\"1.6\">", "</sdf>"]).format(name="crate", static="false", x=0, y=0))
        with pytest.raises(NotFoundError, match="no differential drive"):
            sim.step({"crate": (0.1, 0.0)})
        result = sim.step(None, 0.1)
        assert result.odometry is None and result.scan is None and sim.lasers() == ()


@pytest.mark.parametrize("arguments, error", [
    ({"poses": (1e9, 0.0, 0.0)}, ModelError), ({"poses": {"m2wr": (0.0, -1.1e6, 0.5)}}, ModelError),
    ({"poses": (1.0, 1.0, 0.0), "seed": -1}, ParameterError), ({"poses": {"ghost": (1.0, 1.0, 0.0)}}, NotFoundError),
    ({"poses": (math.nan, 0.0, 0.0), "seed": 2}, ValueError)])
def test_a_reset_that_is_refused_changes_nothing(m2wr_record, arguments, error):
    with Sim("empty", m2wr_record, pose=(3.0, 2.0, 0.0), seed=1) as sim:
        sim.step((0.5, 0.0), 0.2)
        before = sim.pose()
        with pytest.raises(error):
            sim.reset(**arguments)
        assert sim.pose() == before and sim.simulator.config.seed == 1
        assert sim.reset()["m2wr"].position == (3.0, 2.0, 0.1)


def test_a_closed_simulation_says_so(m2wr_record):
    sim = Sim("empty", m2wr_record)
    sim.close()
    sim.close()
    with pytest.raises(RuntimeError, match="closed"):
        sim.step()


def test_no_ros_node_is_needed():
    code = ("import sys\nfrom m2wr_sim.api import Sim\n"
            "with Sim('empty', 'm2wr') as sim:\n    sim.step((0.1, 0.0), 0.1)\n"
            "print([name for name in sys.modules if name.split('.')[0] in ('rospy', 'tf2_ros', 'rosgraph')])\n")
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join(entry for entry in sys.path if entry),
                       ROS_MASTER_URI="http://127.0.0.1:1")
    done = subprocess.run([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, check=True)
    assert done.stdout.decode().split("\n")[-2] == "[]"
