#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Make the bags in test/data again, each with the YAML beside it, from the simulator in this process.

No master is needed: the simulation runs in simulated time only, so the same sources give the same bag, byte for byte.
A bag holds the measurements of a scripted drive; the YAML holds its origin and the expected output of a node,
computed from the world's geometry and the report's tables (`plane_geometry`, `report_rules`).

    rosrun m2wr_test record_fixture.py [NAME ...] [--output FOLDER]     (no NAME: all of them)
"""
import argparse
import copy
import hashlib
import math
import os
import sys
from dataclasses import dataclass

import genpy
import numpy as np
import rosbag
import rospkg
import yaml
from geometry_msgs.msg import TransformStamped, Twist
from tf2_msgs.msg import TFMessage

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.urdf.xacro_text import expand_xacro
from m2wr_sim.physics.engine import settings_from_physics
from m2wr_sim.physics.pyode_engine import PyodeEngine
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

# run as a file of a test package that is not installed: the modules beside it are not on the path
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import plane_geometry  # noqa: E402
import report_rules  # noqa: E402

DATA = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "data")
SCAN, ODOM, TF = "/m2wr/laser/scan", "/odom", "/tf"
STEP_NS = 1000000
START_HEIGHT = 0.1
#: Standard deviation of the laser's noise in the robot's description [m].
NOISE = 0.01
#: Largest difference between a reading and the geometry [m].
RANGE_TOLERANCE = 4.5 * NOISE
RANGE_TOLERANCE_WHY = ("4.5 standard deviations of the laser's noise (0.01 m): a bag holds up to 70000 readings, of "
                       "which the largest error is expected between 4.1 and 4.4")
#: A sector whose minimum changes by more than this [m] under a millimetre, a twentieth of a degree or a quarter of the
#: report's beam spacing at its borders is not compared.
EDGE_CHANGE = 0.02
EDGE_MARGINS = (1e-4, 1.2e-3)
JITTERS = ((0.0, 0.0, 0.0), (0.001, 0.0, 0.0), (-0.001, 0.0, 0.0), (0.0, 0.001, 0.0), (0.0, -0.001, 0.0),
           (0.0, 0.0, 0.001), (0.0, 0.0, -0.001))
#: Rows of the go_to_point table may differ by this time [s]: two periods of its loop.
EDGE_TIME = 0.1


@dataclass(frozen=True)
class Fixture:
    """One recording: start pose, drive, and recorded topics."""

    name: str
    about: str
    world: str
    start: tuple                    # x, y [m], yaw [rad]
    drive: tuple                    # (end [s], linear_x [m/s], angular_z [rad/s]), one after the other
    keep: dict                      # topic -> n: every n-th message is kept
    expect: object                  # function(fixture, recording) -> dict
    seed: int = 1
    laser: tuple = ()               # (old, new) texts replaced in the robot's description
    goal: tuple = ()


@dataclass(frozen=True)
class Recording:
    """Result of a simulated drive: (topic, message, stamp [ns]) in order of time, and the robot's true poses."""

    messages: list
    poses: dict                     # stamp [ns] of a kept scan -> (x, y, yaw)


def make_simulator(fixture):
    """Return a simulator with the fixture's world and robot in it, and its ports."""
    packages = rospkg.RosPack()
    folders = ModelFolders([os.path.join(packages.get_path("m2wr_sim"), "models")])
    world_file = os.path.join(DATA, fixture.world)
    if not os.path.isfile(world_file):
        world_file = os.path.join(packages.get_path("m2wr_sim"), "worlds", fixture.world)
    world = load_world(world_file, resolve_model=folders)
    robot_file = os.path.join(packages.get_path("m2wr_description"), "urdf", "m2wr.xacro")
    robot = load_urdf(robot_text(robot_file, packages, fixture.laser), source=robot_file)
    engine = PyodeEngine(settings_from_physics(world.physics, STEP_NS))
    engine.reseed(fixture.seed)
    ports = LocalPorts(copy.deepcopy)
    simulator = Simulator(engine, RayScene(), ports, SimConfig(seed=fixture.seed, wheel_convention="kinetic"))
    simulator.load_world(world)
    x, y, yaw = fixture.start
    simulator.spawn(robot, ((x, y, START_HEIGHT), quaternion_from_rpy(0.0, 0.0, yaw)), namespace="/")
    return simulator, ports


def robot_text(path, packages, replacements):
    """Return the robot's description as plain URDF with some texts replaced; each must occur exactly once."""
    with open(path, encoding="utf-8") as stream:
        text = expand_xacro(stream.read(), path, packages.get_path)
    for old, new in replacements:
        if text.count(old) != 1:
            raise ValueError("%s: found %d times %s; expected it once" % (path, text.count(old), old))
        text = text.replace(old, new)
    return text


def simulate(fixture):
    """Drive the robot through the fixture's script and return the :class:`Recording`."""
    simulator, ports = make_simulator(fixture)
    scans_seen, poses = 0, {}
    try:
        for until, linear_x, angular_z in fixture.drive:
            command = Twist()
            command.linear.x, command.angular.z = linear_x, angular_z
            ports.send("/cmd_vel", command)
            end_ns = int(round(until * 1e9))
            while simulator.now_ns < end_ns:
                simulator.advance(end_ns)
                scans = ports.topics[SCAN].messages
                if len(scans) > scans_seen:
                    scans_seen = len(scans)
                    poses[scans[-1].header.stamp] = planar(simulator.model_state("m2wr"))
        if simulator.contact_counts:
            raise RuntimeError("%s: contact of the robot: %s; expected none" % (fixture.name, simulator.contacts[0]))
        messages = [(topic, message, stamp_of(message)) for topic, every in sorted(fixture.keep.items())
                    for message in (transforms(ports) if topic == TF else ports.topics[topic].messages)[::every]]
    finally:
        simulator.close()
    messages.sort(key=lambda entry: entry[2])
    return Recording([(topic, with_time(message), stamp) for topic, message, stamp in messages],
                     {stamp: poses[stamp] for topic, _, stamp in messages if topic == SCAN})


def planar(state):
    """Return (x, y, yaw) of a state or an odometry pose."""
    x, y, z, w = state.orientation
    return state.position[0], state.position[1], math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)


def transforms(ports):
    """Return the transforms on /tf as messages; stamps are still integer nanoseconds."""
    found = []
    for stamp, parent, child, position, orientation in ports.transforms:
        transform = TransformStamped()
        transform.header.stamp, transform.header.frame_id, transform.child_frame_id = stamp, parent, child
        where, turn = transform.transform.translation, transform.transform.rotation
        where.x, where.y, where.z = position
        turn.x, turn.y, turn.z, turn.w = orientation
        found.append(TFMessage([transform]))
    return found


def header_of(message):
    """Return the header of a message, of a /tf message that of its transform."""
    return message.transforms[0].header if isinstance(message, TFMessage) else message.header


def stamp_of(message):
    """Return the stamp [ns] of a message as the simulator made it."""
    return header_of(message).stamp


def with_time(message):
    """Return the message with its stamp as ROS time."""
    header = header_of(message)
    header.stamp = genpy.Time(header.stamp // 10**9, header.stamp % 10**9)
    return message


def write_bag(path, messages):
    """Write (topic, message, stamp [ns]) into a bag; equal messages give equal bytes."""
    with rosbag.Bag(path, "w", compression=rosbag.Compression.BZ2) as bag:
        for topic, message, stamp in messages:
            bag.write(topic, message, genpy.Time(stamp // 10**9, stamp % 10**9))


def expect_sectors(fixture, recording):
    """Sector minima of every scan from the boxes' geometry, and what the wall follower may make of them."""
    boxes = plane_geometry.read_boxes(os.path.join(DATA, fixture.world))
    rows, states = [], []
    for _, message, stamp in (entry for entry in recording.messages if entry[0] == SCAN):
        pose = recording.poses[stamp]
        angles = message.angle_min + message.angle_increment * np.arange(len(message.ranges))
        tries = []
        for jitter in JITTERS:
            ranges = plane_geometry.scan(np.add(pose, jitter), angles, boxes)
            tries += [report_rules.sector_minima(ranges, angles, report_rules.READING_LASER_BEAMS, margin)
                      for margin in EDGE_MARGINS]
        spread = np.ptp(np.array(tries), axis=0)
        rows.append([round(stamp * 1e-9, 9)] + [round(value, 6) for value in pose]
                    + [round(value, 4) if change < EDGE_CHANGE else None for value, change in zip(tries[0], spread)])
        allowed = sorted({state for one in tries for state in report_rules.wall_states(one, RANGE_TOLERANCE)})
        states.append([rows[-1][0], allowed])
    return {"sectors": {"columns": ["stamp", "x", "y", "yaw"] + list(report_rules.SECTORS),
                        "tolerance": RANGE_TOLERANCE, "why": RANGE_TOLERANCE_WHY,
                        "null": "an edge of a box, or a beam, is about to enter or leave the sector: not judged",
                        "rows": rows},
            "wall_follower": {"columns": ["stamp", "states that are right"],
                              "commands": {key: list(value) for key, value in report_rules.WALL_COMMANDS.items()},
                              "why": "more than one where a sector is within the tolerance of 1.5 m", "rows": states}}


def expect_go_to_point(fixture, recording):
    """Commands and states of go_to_point along the recorded odometry."""
    rule = report_rules.GoToPointRule(fixture.goal)
    rows, entered = [], []
    for _, message, stamp in recording.messages:
        pose = message.pose.pose
        q = pose.orientation
        yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)
        command, states = rule.turn((pose.position.x, pose.position.y, yaw))
        entered += [[round(stamp * 1e-9, 9), state] for state in states]
        if not rows or rows[-1][1:] != list(command):
            rows.append([round(stamp * 1e-9, 9)] + list(command))
    return {"goal": list(fixture.goal),
            "go_to_point": {"columns": ["from stamp", "linear_x", "angular_z"], "tolerance": EDGE_TIME,
                            "why": "a command may answer the odometry before, and the node's loop has its own beat",
                            "rows": rows, "entered": entered}}


FIXTURES = {fixture.name: fixture for fixture in (
    Fixture("boxes_drive", "a drive along a lane: boxes right, left, on both sides, ahead; then a turn to the left",
            "boxes.world", (0.0, 0.0, 0.0),
            ((0.5, 0.0, 0.0), (15.7, 0.5, 0.0), (16.2, 0.0, 0.0), (19.3, 0.0, 0.5), (19.8, 0.0, 0.0)),
            {SCAN: 4, ODOM: 1, TF: 1}, expect_sectors),
    Fixture("yard_360", "one turn on the spot with a scanner of 360 beams all the way round, beginning ahead",
            "yard.world", (0.0, 0.0, 0.0), ((0.5, 0.0, 0.0), (16.2, 0.0, 0.4), (16.7, 0.0, 0.0)), {SCAN: 5, ODOM: 1},
            expect_sectors, seed=2,
            laser=(("<samples>720</samples>", "<samples>360</samples>"),
                   ("<min_angle>-1.570796</min_angle>", "<min_angle>0</min_angle>"),
                   ("<max_angle>1.570796</max_angle>", "<max_angle>6.28319</max_angle>"))),
    Fixture("turn_and_go", "a scripted turn to a goal across the heading of 180 degrees, a drive past it, a correction",
            "empty.world", (0.0, 0.0, 1.9),
            ((0.5, 0.0, 0.0), (2.25, 0.0, 0.7), (2.5, 0.0, 0.0), (5.2, 0.6, 0.0), (5.35, 0.0, 0.0), (5.4, 0.0, 0.85),
             (5.6, 0.0, 0.0), (6.95, 0.6, 0.0), (7.0, 0.6, -0.7), (7.4, 0.0, 0.0), (7.55, 0.0, 0.7), (8.2, 0.0, 0.0)),
            {ODOM: 1}, expect_go_to_point, seed=3, goal=(-2.8, -0.06)),
)}


def origin(fixture, recording, bag_path):
    """Return the origin and the contents of the bag, for the YAML."""
    topics = {}
    for topic, message, _ in recording.messages:
        entry = topics.setdefault(topic, {"type": message._type, "count": 0})
        entry["count"] += 1
    with open(bag_path, "rb") as stream:
        digest = hashlib.md5(stream.read()).hexdigest()
    return {"about": fixture.about, "bag": os.path.basename(bag_path), "md5": digest,
            "command": "rosrun m2wr_test record_fixture.py %s" % fixture.name,
            "commit": "made by record_fixture.py %s of the commit that last changed this file" % fixture.name,
            "world": fixture.world, "robot": "m2wr_description/urdf/m2wr.xacro, wheel_convention kinetic",
            "robot_changes": [list(pair) for pair in fixture.laser], "seed": fixture.seed,
            "step": STEP_NS * 1e-9, "start": list(fixture.start), "drive_columns": ["until", "linear_x", "angular_z"],
            "drive": [list(row) for row in fixture.drive], "topics": topics}


def make(fixture, folder):
    """Simulate one fixture and write its bag and YAML into ``folder``; returns both paths."""
    recording = simulate(fixture)
    bag_path = os.path.join(folder, fixture.name + ".bag")
    write_bag(bag_path, recording.messages)
    content = origin(fixture, recording, bag_path)
    content["expected"] = fixture.expect(fixture, recording)
    yaml_path = os.path.join(folder, fixture.name + ".yaml")
    with open(yaml_path, "w", encoding="utf-8") as stream:
        stream.write("# Written by test/scripts/record_fixture.py; change it there and make it again.\n")
        yaml.safe_dump(content, stream, default_flow_style=None, sort_keys=False, width=118)
    return bag_path, yaml_path


def main():
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of: %s; default: all" % ", ".join(FIXTURES))
    parser.add_argument("--output", default=DATA, help="folder to write into (default: test/data)")
    options = parser.parse_args()
    unknown = sorted(set(options.names) - set(FIXTURES))
    if unknown:
        parser.error("no fixture %s; there are %s" % (", ".join(unknown), ", ".join(FIXTURES)))
    for name in options.names or FIXTURES:
        bag_path, yaml_path = make(FIXTURES[name], options.output)
        sys.stdout.write("%s (%d kB), %s\n" % (bag_path, os.path.getsize(bag_path) // 1000, yaml_path))
    return 0


if __name__ == "__main__":
    sys.exit(main())
