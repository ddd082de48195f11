# SPDX-License-Identifier: BSD-3-Clause
"""The recorded bags agree with their YAMLs and with the geometry, and can be made again."""
import dataclasses
import hashlib
import io
import math
import os
import sys

import numpy as np
import pytest
import yaml
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TEST = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
DATA = os.path.join(TEST, "data")
sys.path.insert(0, os.path.join(TEST, "scripts"))
import plane_geometry  # noqa: E402
import record_fixture  # noqa: E402
import report_rules  # noqa: E402

SCAN, ODOM, TF = record_fixture.SCAN, record_fixture.ODOM, record_fixture.TF
FIXTURES = record_fixture.FIXTURES
STORE = get_typestore(Stores.ROS1_NOETIC)
LARGEST_BAG = 600000
#: Largest difference between a number in a bag and the same one made again: the last digits depend on the machine.
REMAKE_TOLERANCE = 1e-5
#: Share of beams that may graze an edge and differ from the geometry.
GRAZING = 0.005
#: Beams beyond this angle see the robot's own wheels, which extend above the laser's plane [rad].
OWN_WHEELS = math.radians(100.0)


def read_info(name):
    """Return the YAML beside a bag."""
    with open(os.path.join(DATA, name + ".yaml"), encoding="utf-8") as stream:
        return yaml.safe_load(stream)


def read_bag(name):
    """Return [(topic, type, stamp [ns], raw bytes)] of a bag."""
    with Reader(os.path.join(DATA, name + ".bag")) as reader:
        for connection in reader.connections:
            try:
                STORE.get_msgdef(connection.msgtype)
            except KeyError:        # not one of the common types: the bag contains the definition
                STORE.register(get_types_from_msg(connection.msgdef, connection.msgtype))
        return [(connection.topic, connection.msgtype, stamp, bytes(raw))
                for connection, stamp, raw in reader.messages()]


def read_messages(name, topic):
    """Return [(stamp [ns], message)] of one topic."""
    found = [(stamp, STORE.deserialize_ros1(raw, kind)) for one, kind, stamp, raw in read_bag(name) if one == topic]
    assert found, "%s.bag holds nothing on %s" % (name, topic)
    return found


def planar(message):
    """Return (x, y, yaw) of an odometry message."""
    where, q = message.pose.pose.position, message.pose.pose.orientation
    return where.x, where.y, 2.0 * math.atan2(q.z, q.w)


def flat(value):
    """Return all (texts, numbers) of a message."""
    if isinstance(value, str):
        return [value], []
    if dataclasses.is_dataclass(value):
        value = [getattr(value, field.name) for field in dataclasses.fields(value) if field.name != "__msgtype__"]
    if isinstance(value, np.ndarray) and value.dtype != object:
        return [], value.ravel().tolist()
    if isinstance(value, (list, np.ndarray)):
        parts = [flat(part) for part in value]
        return sum((part[0] for part in parts), []), sum((part[1] for part in parts), [])
    return [], [float(value)]


def beam_angles(scan):
    """Return the beams' angles [rad] in [-pi, pi)."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    return (angles + math.pi) % (2 * math.pi) - math.pi


@pytest.fixture(scope="module")
def recordings():
    """Every fixture, simulated again."""
    return {name: record_fixture.simulate(fixture) for name, fixture in FIXTURES.items()}


def test_every_bag_has_its_yaml_and_its_recipe():
    bags = {name[:-4] for name in os.listdir(DATA) if name.endswith(".bag")}
    assert bags == set(FIXTURES)
    assert all(os.path.isfile(os.path.join(DATA, name + ".yaml")) for name in bags)


@pytest.mark.parametrize("name", FIXTURES)
def test_bag_agrees_with_the_yaml(name):
    info, path = read_info(name), os.path.join(DATA, name + ".bag")
    with open(path, "rb") as stream:
        content = stream.read()
    assert hashlib.md5(content).hexdigest() == info["md5"]
    assert len(content) < LARGEST_BAG
    topics, last = {}, 0
    for topic, kind, stamp, raw in read_bag(name):
        assert stamp >= last
        last = stamp
        entry = topics.setdefault(topic, {"type": kind.replace("/msg/", "/"), "count": 0})
        entry["count"] += 1
        message = STORE.deserialize_ros1(raw, kind)
        header = message.transforms[0].header if topic == TF else message.header
        assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp
    assert topics == info["topics"]
    assert "/clock" not in topics


@pytest.mark.parametrize("name", FIXTURES)
def test_yaml_agrees_with_the_recipe(name):
    info, fixture = read_info(name), FIXTURES[name]
    assert info["seed"] == fixture.seed
    assert info["world"] == fixture.world
    assert info["start"] == list(fixture.start)
    assert info["drive"] == [list(row) for row in fixture.drive]
    assert info["command"].split()[-1] == name


@pytest.mark.parametrize("name", FIXTURES)
def test_simulator_makes_the_same_messages_again(name, recordings):
    old, new = read_bag(name), recordings[name].messages
    advice = "%s.bag differs from the simulator's output; if intended, run test/scripts/record_fixture.py" % name
    assert [(topic, stamp) for topic, _, stamp, _ in old] == [(topic, stamp) for topic, _, stamp in new], advice
    for (topic, kind, stamp, raw), (_, message, _) in zip(old, new):
        buffer = io.BytesIO()
        message.serialize(buffer)
        if buffer.getvalue() == raw:
            continue
        before, after = (flat(STORE.deserialize_ros1(data, kind)) for data in (raw, buffer.getvalue()))
        assert before[0] == after[0], advice
        np.testing.assert_allclose(after[1], before[1], rtol=0, atol=REMAKE_TOLERANCE,
                                   err_msg="%s: %s at %d ns" % (advice, topic, stamp))


@pytest.mark.parametrize("name", FIXTURES)
def test_expectations_agree_with_the_recipe(name, recordings):
    expected = FIXTURES[name].expect(FIXTURES[name], recordings[name])
    stored = read_info(name)["expected"]
    assert set(stored) == set(expected)
    for part in ("wall_follower", "go_to_point"):
        assert stored.get(part) == expected.get(part)
    if "sectors" in stored:
        for old, new in zip(stored["sectors"]["rows"], expected["sectors"]["rows"]):
            assert [value is None for value in old] == [value is None for value in new]
            np.testing.assert_allclose([value or 0.0 for value in new], [value or 0.0 for value in old], atol=2e-4)


def test_equal_messages_give_equal_bags(tmp_path, recordings):
    paths = [str(tmp_path / name) for name in ("first.bag", "second.bag")]
    for path in paths:
        record_fixture.write_bag(path, recordings["yard_360"].messages)
    first, second = (open(path, "rb").read() for path in paths)
    assert first == second


def test_a_text_that_is_not_in_the_robot_is_named():
    fixture = dataclasses.replace(FIXTURES["yard_360"], laser=(("<samples>721</samples>", ""),))
    with pytest.raises(ValueError, match="found 0 times <samples>721</samples>; expected it once"):
        record_fixture.simulate(fixture)


@pytest.mark.parametrize("name", ["boxes_drive", "yard_360"])
def test_sectors_of_the_scans_are_those_of_the_geometry(name):
    expected = read_info(name)["expected"]["sectors"]
    scans = read_messages(name, SCAN)
    assert len(scans) == len(expected["rows"])
    judged = 0
    for (stamp, scan), row in zip(scans, expected["rows"]):
        assert round(row[0] * 1e9) == stamp
        least = report_rules.sector_minima(scan.ranges, beam_angles(scan), report_rules.READING_LASER_BEAMS)
        for sector, value, wanted in zip(report_rules.SECTORS, least, row[4:]):
            if wanted is not None:
                judged += 1
                assert abs(value - wanted) <= expected["tolerance"], (sector, row)
    assert judged >= 0.95 * 5 * len(scans)


@pytest.mark.parametrize("name", ["boxes_drive", "yard_360"])
def test_readings_match_geometry_and_noise_of_the_description(name):
    boxes = plane_geometry.read_boxes(os.path.join(DATA, FIXTURES[name].world))
    rows = read_info(name)["expected"]["sectors"]["rows"]
    errors = []
    for (_, scan), row in zip(read_messages(name, SCAN), rows):
        angles = beam_angles(scan)
        forward = np.abs(angles) < OWN_WHEELS
        wanted = plane_geometry.scan(row[1:4], angles, boxes)[forward]
        read = scan.ranges[forward].astype(float)
        with np.errstate(invalid="ignore"):
            errors.append(read - wanted)        # infinite if only one of them is, nan if both are
    errors = np.concatenate(errors)
    errors = errors[~np.isnan(errors)]
    plain = np.abs(errors) < 6 * record_fixture.NOISE
    assert np.mean(~plain) < GRAZING
    noise = errors[plain]
    assert len(noise) > 3000
    # 5 standard deviations of the estimates themselves
    assert abs(np.mean(noise)) < 5 * record_fixture.NOISE / math.sqrt(len(noise)) + 2e-4
    assert abs(np.std(noise) / record_fixture.NOISE - 1.0) < 5 / math.sqrt(2 * len(noise)) + 0.005


def test_boxes_are_where_the_world_file_has_them():
    rows = {row[0]: row for row in read_info("boxes_drive")["expected"]["sectors"]["rows"]}
    # at rest at the origin the nearest corner on the right is (2.2, -0.7), seen from the laser at x = 0.15
    assert rows[0.201][5] == pytest.approx(math.hypot(2.05, 0.7), abs=0.005)
    # beside the box its face is 0.7 m to the right
    assert rows[4.801][4] == pytest.approx(0.7, abs=0.002)
    # facing the wall across the lane, whose face is at x = 9
    assert rows[15.001][6] == pytest.approx(9.0 - (rows[15.001][1] + 0.15), abs=0.002)


def test_robot_has_the_speeds_of_the_script():
    poses = {stamp: planar(message) for stamp, message in read_messages("boxes_drive", ODOM)}
    first, second = poses[5051000000], poses[15051000000]
    assert second[0] - first[0] == pytest.approx(0.5 * 10.0, rel=1e-3)
    assert abs(second[1] - first[1]) < 1e-3
    first, second = poses[17051000000], poses[19051000000]
    assert second[2] - first[2] == pytest.approx(0.5 * 2.0, rel=1e-3)
    # it rotates about the axle
    assert np.hypot(*np.subtract(plane_geometry.axle(first), plane_geometry.axle(second))) < 1e-3


def test_tf_is_the_odometry():
    transforms = dict(read_messages("boxes_drive", TF))
    for stamp, message in read_messages("boxes_drive", ODOM):
        transform = transforms[stamp].transforms[0]
        assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "link_chassis")
        assert transform.transform.translation.x == message.pose.pose.position.x
        assert transform.transform.translation.y == message.pose.pose.position.y
        assert transform.transform.rotation.z == message.pose.pose.orientation.z


def test_rotation_of_go_to_point_ends_at_the_closed_form_time():
    info = read_info("turn_and_go")
    expected, (x, y, yaw) = info["expected"], info["start"]
    goal = expected["goal"]
    error = (math.atan2(goal[1] - y, goal[0] - x) - yaw) % (2 * math.pi)
    turned = 0.5 + (error - math.pi / 90) / 0.7
    state, stamp = expected["go_to_point"]["entered"][0][::-1]
    assert state == 1
    assert stamp == pytest.approx(turned, abs=0.1)
    # the rotation to the goal crosses the heading of 180 degrees: an error without wrapping would turn the other way
    assert math.atan2(goal[1] - y, goal[0] - x) - yaw < -math.pi
    assert [state for _, state in expected["go_to_point"]["entered"]] == [1, 0, 1, 2, 0, 1, 2]


def test_rays_and_clearances_equal_their_closed_forms():
    ahead = plane_geometry.Rectangle(3.0, 0.0, 0.0, 2.0, 2.0)
    turned = plane_geometry.Rectangle(3.0, 0.0, math.pi / 4, 2.0, 2.0)
    angles = np.array((0.0, math.atan2(0.9, 2.0), math.pi / 2, math.pi))
    np.testing.assert_allclose(plane_geometry.ray_distances((0.0, 0.0), angles, [ahead]),
                               (2.0, math.hypot(2.0, 0.9), math.inf, math.inf))
    np.testing.assert_allclose(plane_geometry.ray_distances((0.0, 0.0), angles[:1], [turned]), 3.0 - math.sqrt(2.0))
    # the tip of the caster is 0.4 m ahead of the chassis, the wheels' sides 0.22 m beside it
    assert plane_geometry.clearance((0.0, 0.0, 0.0), [ahead]) == pytest.approx(1.6, abs=1e-3)
    assert plane_geometry.clearance((2.95, -1.5, 0.0), [ahead]) == pytest.approx(0.28, abs=1e-3)
    assert plane_geometry.clearance((2.0, 0.0, 0.0), [ahead]) < 0.0


def test_driving_a_quarter_circle_ends_beside_its_centre():
    pose = plane_geometry.drive((0.05, 0.0, 0.0), 0.5, 0.5, math.pi)       # axle at the origin, radius 1 m
    np.testing.assert_allclose(pose, (1.0, 1.05, math.pi / 2), atol=1e-12)
    np.testing.assert_allclose(plane_geometry.drive((0.05, 0.0, 0.0), 0.5, 0.0, 2.0), (1.05, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("front, fleft, fright, states", [
    (9, 9, 9, [0]), (1, 9, 9, [1]), (9, 9, 1, [2]), (9, 1, 9, [0]), (1, 9, 1, [1]), (1, 1, 9, [1]), (1, 1, 1, [1]),
    (9, 1, 1, [0]), (9, 9, 1.52, [0, 2]), (1.48, 9, 9, [0, 1]), (1.5, 9, 1.5, [0, 1, 2])])
def test_wall_states_are_the_reports_table(front, fleft, fright, states):
    assert report_rules.wall_states((10.0, fright, front, fleft, 10.0), 0.045) == states
