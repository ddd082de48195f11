# SPDX-License-Identifier: BSD-3-Clause
"""Logs made by the simulator: odometry and scans against closed forms, sets, files and the command."""
import json
import math
from dataclasses import replace

import numpy as np
import pytest
import rosbag

from m2wr_maps.se2 import compose, inverse
from m2wr_tools.buildings.floor_plan import WALL_THICKNESS, FloorPlan
from m2wr_tools.slam_benchmark.trajectory_errors import rows
from m2wr_tools.slam_logs import log_files, log_sets, make_command
from m2wr_tools.slam_logs.difficulties import CLASSES, PLAIN, real_ones
from m2wr_tools.slam_logs.drive import Drive, Driver, StuckError, Upset, drive, tour
from m2wr_tools.slam_logs.log_files import EPOCH, arrivals, drift, write
from m2wr_tools.slam_logs.log_sets import RANGES, SETS, SPARSE, Faults, MadeLog, make, recipe
from m2wr_tools.slam_logs.odometry import RADIUS, SEPARATION, OdometryErrors, integrate
from m2wr_tools.slam_logs.sensing import MOUNT, LaserErrors, scans

NO_SHAPES = dict(boxes=np.empty((0, 5)), pillars=np.empty((0, 3)))
CORNERS = np.array([[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0], [0.0, 0.0]])
ROOM = FloorPlan("room", np.hstack([CORNERS[:-1], CORNERS[1:]]), np.zeros(len(CORNERS) - 1, bool),
                 places=np.array([[1.5, 1.5], [6.0, 1.5], [6.0, 4.5]]), **NO_SHAPES)


@pytest.fixture(scope="module")
def driven():
    """Return a drive along two sides of the room, with a turn on the spot."""
    driver = Driver(ROOM, np.array([1.5, 1.5, 0.0]), 1)
    driver.follow(ROOM.places[1:2])
    driver.spin(2.0 * math.pi)
    driver.follow(ROOM.places[2:])
    return driver.record()


def test_a_stuck_robot_is_reported_and_can_back_off():
    driver = Driver(ROOM, np.array([6.0, 3.0, 0.0]), 1)
    with pytest.raises(StuckError, match="the robot is stuck at"):
        driver.follow(np.array([[20.0, 3.0]]))              # behind the wall at x = 8
    before = driver.pose
    driver.back_off()
    assert before[0] - driver.pose[0] > 0.3


def test_a_tour_follows_the_order_of_the_plan():
    places = list(tour(replace(ROOM, in_order=True), 17.0, np.random.default_rng(1)))
    assert np.array(places) == pytest.approx(ROOM.places[[1, 2, 0, 1, 0]])


def still(pose, count=2):
    return Drive(0.1 * np.arange(count), np.tile(pose, (count, 1)), np.zeros((count, 2)), [])


def test_the_robot_reaches_the_places(driven):
    assert np.hypot(*(driven.poses[-1, :2] - ROOM.places[2])) < 0.2
    assert 7.0 < driven.length < 9.0
    (begin, end), = driven.spins
    assert np.unwrap(driven.poses[begin:end + 1, 2])[-1] - driven.poses[begin, 2] > 2.0 * math.pi - 0.2


def test_odometry_of_exact_wheels_agrees_with_the_pose(driven):
    found = integrate(driven, OdometryErrors(), np.random.default_rng(1))
    true = compose(inverse(driven.poses[0]), driven.poses[-1])
    assert np.hypot(*(found[-1, :2] - true[:2])) < 0.01 * driven.length
    assert math.remainder(found[-1, 2] - true[2], 2.0 * math.pi) == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("errors, expected", [
    (OdometryErrors(), (2.0, 1.0)), (OdometryErrors(radius=(0.1, 0.1)), (2.2, 1.1)),
    (OdometryErrors(separation=0.25), (2.0, 0.8))])
def test_errors_of_odometry_are_those_of_the_formula(errors, expected):
    """Driving 2 m straight, then turning by 1 rad."""
    straight, turn = 2.0 / RADIUS, 0.5 * SEPARATION / RADIUS
    wheels = np.vstack([np.linspace([0.0, 0.0], [straight, straight], 11),
                        np.linspace([straight, straight], [straight - turn, straight + turn], 11)[1:]])
    found = integrate(Drive(np.arange(21.0), np.zeros((21, 3)), wheels, [(10, 20)]), errors, np.random.default_rng(1))
    assert found[-1, [0, 2]] == pytest.approx(expected)


def test_odometry_of_a_wrong_centre_moves_sideways_in_a_turn():
    turn = 0.5 * math.pi * 0.5 * SEPARATION / RADIUS
    done = Drive(np.arange(11.0), np.zeros((11, 3)), np.linspace([0.0, 0.0], [-turn, turn], 11), [])
    found = integrate(done, OdometryErrors(centre=(0.1, 0.0)), np.random.default_rng(1))
    assert found[-1] == pytest.approx([0.1, -0.1, 0.5 * math.pi])


def test_a_wheel_slips_as_often_as_requested():
    """Each burst of 3 records of 1 cm changes one wheel's distance by a quarter on average."""
    wheels = np.linspace([0.0, 0.0], [1000.0 / RADIUS] * 2, 100001)
    done = Drive(np.arange(100001.0), np.zeros((100001, 3)), wheels, [])
    found = integrate(done, OdometryErrors(bursts=0.5), np.random.default_rng(1))
    turned = np.abs(np.diff(np.unwrap(found[:, 2])))
    assert (turned > 1e-9).sum() / 3 == pytest.approx(500, abs=70)
    assert turned[turned > 1e-9].mean() == pytest.approx(0.25 * 0.01 / SEPARATION, rel=0.1)


def test_a_robot_that_is_carried_measures_nothing():
    driver = Driver(ROOM, np.array([4.0, 3.0, 0.0]), 1)
    driver.upset(Upset(math.pi, 1.0, carried=True))
    done = driver.record()
    (begin, end), = done.carried
    assert abs(done.poses[end, 2]) > 3.0
    odometry = integrate(done, OdometryErrors(), np.random.default_rng(1))
    assert odometry[begin:end + 1] == pytest.approx(np.tile(odometry[begin], (end + 1 - begin, 1)))
    taken, _ = scans(ROOM, done, 1, LaserErrors(beams=3), np.random.default_rng(1))
    assert not ((taken > begin) & (taken <= end)).any() and taken[-1] >= begin


def test_a_robot_that_is_pushed_still_scans():
    driver = Driver(ROOM, np.array([4.0, 3.0, 0.0]), 1)
    driver.upset(Upset(-2.0, 3.0, carried=False))
    done = driver.record()
    (begin, end), = done.pushed
    assert done.poses[end, 2] == pytest.approx(-2.0, abs=0.2) and end - begin <= 9
    odometry = integrate(done, OdometryErrors(), np.random.default_rng(1))
    assert odometry[begin:end + 1] == pytest.approx(np.tile(odometry[begin], (end + 1 - begin, 1)))
    taken, _ = scans(ROOM, done, 1, LaserErrors(beams=3), np.random.default_rng(1))
    assert len(taken) == len(done.stamps)


def test_encoder_steps_are_rounded_down():
    wheels = np.array([[0.0, 0.0], [0.3, 0.3], [2.0, 2.0]])
    done = Drive(np.arange(3.0), np.zeros((3, 3)), wheels, [])
    found = integrate(done, OdometryErrors(ticks=4), np.random.default_rng(1))
    assert found[:, 0] == pytest.approx([0.0, 0.0, 0.5 * math.pi * RADIUS])


@pytest.mark.parametrize("mount, ahead", [((0.0, 0.0, 0.0), 3.0), ((0.05, 0.0, 0.0), 2.95),
                                          ((0.0, 0.0, math.pi), 5.0)])
def test_ranges_are_measured_from_the_true_mount(mount, ahead):
    laser = LaserErrors(beams=3, field=math.radians(1.0), noise=0.0, mount=mount)
    _, ranges = scans(ROOM, still((5.0 - MOUNT[0], 3.0, 0.0)), 1, laser, np.random.default_rng(1))
    assert ranges[0, 1] == pytest.approx(ahead - 0.5 * WALL_THICKNESS, abs=1e-4)


def test_glass_reflects_near_the_perpendicular_only():
    inner = np.vstack([ROOM.walls, [[6.0, 0.0, 6.0, 6.0]]])
    plan = replace(ROOM, walls=inner, glass=np.array([False] * 4 + [True]))
    laser = LaserErrors(beams=3, field=math.radians(60.0), noise=0.0)
    _, ranges = scans(plan, still((4.0 - MOUNT[0], 3.0, 0.0)), 1, laser, np.random.default_rng(1))
    assert ranges[0, 1] == pytest.approx(2.0 - 0.5 * WALL_THICKNESS, abs=1e-4)
    slanted = (4.0 - 0.5 * WALL_THICKNESS) / math.cos(math.radians(30.0))
    assert ranges[0, [0, 2]] == pytest.approx(slanted, abs=1e-3)


def test_people_walk_and_stay_away_from_the_robot():
    laser = LaserErrors(beams=360, field=2.0 * math.pi, noise=0.0, people=3)
    _, ranges = scans(ROOM, still((4.0, 3.0, 0.0), 60), 1, laser, np.random.default_rng(2))
    _, empty = scans(ROOM, still((4.0, 3.0, 0.0), 60), 1, replace(laser, people=0), np.random.default_rng(2))
    seen = np.abs(ranges - empty) > 0.1
    assert (seen[0] != seen[-1]).any() and seen.any(axis=1).all()


def test_buildings_without_two_connected_places_are_refused():
    with pytest.raises(StuckError, match="1 places to visit; expected at least 2"):
        drive(replace(ROOM, places=ROOM.places[:1]), 10.0, np.random.default_rng(1))
    walled = replace(ROOM, walls=np.vstack([ROOM.walls, [[3.0, 0.0, 3.0, 6.0]]]), glass=np.zeros(5, bool),
                     places=ROOM.places[:2])
    with pytest.raises(StuckError, match="no other place .* can be reached"):
        drive(walled, 10.0, np.random.default_rng(1))


def test_every_class_of_a_set_is_drawn_several_times():
    for name in SETS:
        logs = [recipe(name, number).difficulties for number in range(100)]
        for aspect, classes in CLASSES.items():
            counts = [sum(log[aspect] == one for log in logs) for one in classes]
            assert sum(counts) >= 100 and min(counts) >= 100 // len(classes) - 1
        pairs = {(log["building"], log["odometry"]) for log in logs}
        assert len(pairs) > 35              # of 56: not always the same together


def test_a_recipe_has_what_its_difficulties_say():
    for log in (recipe("exam", number) for number in range(60)):
        low, high = RANGES[log.difficulties["range"]]
        assert low <= log.laser.range_max <= high
        assert bool(log.laser.mount[2]) == ("yaw" in log.difficulties["mount"])
        assert bool(log.laser.mount[0]) == bool(log.laser.mount[1]) == ("offset" in log.difficulties["mount"])
        assert (log.upset is None) == (log.difficulties["turn"] == "measured")
        assert log.upset is None or log.upset.carried == (log.difficulties["turn"] == "carried")
        assert (log.every == SPARSE) == (log.difficulties["scans"] == "sparse")
        assert bool(log.faults.dropped) == ("dropped" in log.difficulties["scans"])
        assert bool(log.faults.late) == ("late" in log.difficulties["scans"])
        assert bool(log.glass) == ("glass" in log.difficulties["surroundings"])
        assert bool(log.laser.people) == ("people" in log.difficulties["surroundings"])
        assert set(real_ones(log.difficulties).items()) <= set(log.difficulties.items())
    assert real_ones(dict(PLAIN, building="hall")) == dict(building="hall")


def test_sets_have_different_logs():
    names = {name: [recipe(name, number) for number in range(8)] for name in SETS}
    one, other = names["development"], names["exam"]
    assert not {log.laser.range_max for log in one} & {log.laser.range_max for log in other}
    assert recipe("exam", 5) == other[5]
    with pytest.raises(ValueError, match="expected a number from 0 of development or exam"):
        recipe("training", 1)


def short(name, number):
    """Return the recipe of a drive of a few metres."""
    return replace(recipe(name, 4), length=4.0, kind="hall", name="%s_%d" % (name, number),
                   upset=Upset(1.0, 2.0, carried=False), laser=LaserErrors(beams=90, people=1),
                   faults=Faults(0.2, 0.05, 0.1))


def test_a_log_is_repeated_to_the_byte(tmp_path, monkeypatch):
    monkeypatch.setattr(log_sets, "recipe", short)
    paths = []
    for folder in ("one", "other"):
        (tmp_path / folder).mkdir()
        paths.append(write(make("exam", 3), str(tmp_path / folder), np.random.default_rng(1)))
    assert open(paths[0], "rb").read() == open(paths[1], "rb").read()
    truth = rows(paths[0][:-len("bag")] + "graph", 4)
    with rosbag.Bag(paths[0]) as bag:
        stamps = [message.header.stamp.to_sec() for _, message, _ in bag.read_messages(topics=["/scan"])]
    assert 0.6 * len(truth) < len(stamps) < 0.95 * len(truth)
    assert set(np.round(stamps, 4)) <= set(np.round(truth[:, 0], 4)) and stamps != sorted(stamps)
    details = json.load(open(paths[0][:-len("bag")] + "json"))
    assert details["laser"]["beams"] == 90 and details["metres"] > 4.0


@pytest.fixture
def plain_log():
    """Return a log without a drive, of 1000 scans."""
    count = 1000
    poses = np.zeros((count, 3))
    return MadeLog(recipe("exam", 0), ROOM, Drive(0.1 * np.arange(count), poses, np.zeros((count, 2)), []), poses,
                   np.arange(count), np.zeros((count, 1), np.float32))


@pytest.mark.parametrize("faults, changed", [
    (Faults(), 0), (Faults(dropped=0.3), 300), (Faults(swapped=0.1), 100), (Faults(late=0.1), 100)])
def test_faults_have_the_share_that_is_requested(plain_log, faults, changed):
    log = replace(plain_log, recipe=replace(plain_log.recipe, faults=faults))
    found = arrivals(log, np.random.default_rng(1))
    late = sum(time > stamp + 1e-6 for time, stamp in ((time, 0.1 * index) for time, index in found))
    assert (1000 - len(found)) + late == pytest.approx(changed, abs=50)
    assert found == sorted(found)


def test_drift_is_relative_to_the_length():
    poses = np.array([[1.0, 1.0, 0.5 * math.pi], [1.0, 11.0, 0.5 * math.pi]])
    done = Drive(np.arange(2.0), poses, np.zeros((2, 2)), [])
    log = MadeLog(recipe("exam", 0), ROOM, done, np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]]), np.arange(2),
                  np.zeros((2, 1), np.float32))
    assert drift(log) == pytest.approx(0.1)
    assert EPOCH > 0.0 and log_files.DELAY > 0.0


def test_the_command_keeps_logs_and_reports_failures(tmp_path, monkeypatch, capsys):
    made = []

    class Here:
        """Runs jobs in this process."""

        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            return False

        def imap_unordered(self, function, jobs):
            return map(function, jobs)

    def fake(name, number):
        made.append(number)
        if number == 2:
            raise StuckError("the robot is stuck")
        return replace(log_of_a_set, recipe=recipe(name, number))

    count = 4
    done = Drive(np.arange(float(count)), np.zeros((count, 3)), np.zeros((count, 2)), [])
    log_of_a_set = MadeLog(recipe("exam", 0), ROOM, done, np.zeros((count, 3)), np.arange(count),
                           np.ones((count, 1), np.float32))
    monkeypatch.setattr(make_command, "Pool", Here)
    monkeypatch.setattr(log_sets, "make", fake)
    folder = str(tmp_path / "logs")
    assert make_command.main([folder, "--set", "exam", "--first", "1", "--count", "3"]) == make_command.FAILED
    assert "1 of 3 logs could not be made: exam_002" in capsys.readouterr().err
    assert make_command.main([folder, "--set", "exam", "--first", "1", "--count", "1"]) == 0
    assert made == [1, 2, 3] and "there already" in capsys.readouterr().err


@pytest.mark.parametrize("words, told", [
    (["x", "--count", "0"], "expected at least 1"), (["x", "--count", "-1"], "expected"),
    (["x", "--set", "other"], "invalid choice: 'other'"), ([], "folder")])
def test_bad_arguments_are_refused(words, told, capsys):
    with pytest.raises(SystemExit) as error:
        make_command.main(words)
    assert error.value.code == 2 and told in capsys.readouterr().err
