# SPDX-License-Identifier: BSD-3-Clause
"""What the original does wrong and its users know: none of it here. Lasers and bad input have tests of their own."""
import math
import threading
import tracemalloc

import numpy as np
import pytest
import rospy

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.filter.occupancy import Grid, Occupancy
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.ros.missing_inputs import name_what_is_missing
from m2wr_gmapping.ros.node_parameters import tf_prefix, with_prefix
from m2wr_gmapping.ros.outputs import MapOutput


def test_the_limits_of_the_map_change_no_match(mapped):
    paths = []
    for limit in (10.0, 1.0, 37.3):
        mapper, _, _ = mapped(laps=0.4, xmin=-limit, xmax=limit, ymin=-limit, ymax=2.0 * limit)
        paths.append(mapper.trajectory()[1])
        mapper.close()
    np.testing.assert_array_equal(paths[0], paths[1])
    np.testing.assert_array_equal(paths[0], paths[2])


@pytest.mark.parametrize("last_is_angle_max", [True, False])
@pytest.mark.parametrize("count", [181, 360])
def test_filter_and_map_have_each_beam_at_its_angle(count, last_is_angle_max):
    step = math.radians(1.0)
    laser = LaserModel.from_message(-0.5 * math.pi, -0.5 * math.pi + step * (count - last_is_angle_max), step, count,
                                    0.1, 10.0)
    angles = -0.5 * math.pi + step * np.arange(count)
    reading = laser.reading(np.full(count, 2.0))
    turn = laser.sensor_pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))[2]
    c, s = math.cos(turn), math.sin(turn)
    right = 2.0 * np.stack([np.cos(angles), np.sin(angles)])
    for ends in (reading.points, reading.beams[:2], reading.rays):
        np.testing.assert_allclose(np.array([[c, -s], [s, c]]) @ ends, right, atol=1e-6)


def test_the_origin_is_the_middle_of_the_first_cell():
    laser = LaserModel.from_message(0.0, 0.0, 0.1, 1, 0.1, 10.0)
    grid = Occupancy((-1.0, -1.0, 5.4, 5.4), 0.1, 0.25)
    grid.update(np.zeros((1, 3)), [laser.reading([2.04])])
    found = grid.grid()
    row, column = np.argwhere(found.data == 100)[0]
    assert found.origin.tolist() == [-1.0, -1.0]
    assert found.origin[0] + 0.1 * column == pytest.approx(2.0) and found.origin[1] + 0.1 * row == pytest.approx(0.0)


def test_readings_of_nothing_and_of_no_number_are_left_out_everywhere(ring, laser):
    ranges = ring.ranges(drive(0.1)[0], laser.angles)
    whole = laser.reading(ranges)
    for value in (0.0, -1.0, math.nan, math.inf, -math.inf, 1e30):
        few = ranges.copy()
        few[10:20] = value
        reading = laser.reading(few)
        kept = np.r_[0:10, 20:181]
        assert reading.points.shape[1] == reading.beams.shape[1] == 171
        np.testing.assert_array_equal(reading.points, whole.points[:, kept])
        assert np.isfinite(reading.beams).all()
        # free space is cleared, if at all, to the end of the laser's reach: nothing was there
        assert reading.rays.shape[1] - 171 in (0, 10)
        assert reading.ray_hits.sum() == 171


def test_the_time_of_the_last_update_begins_with_the_first_scan(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2, "temporalUpdate": 5.0}), laser)
    reading = mapper.reading(ring.ranges(drive(0.1)[0], laser.angles))
    done = [mapper.process(reading, np.zeros(3), 1e9 + at).processed for at in (0.0, 0.1, 5.0, 5.1, 10.0, 10.3)]
    assert done == [True, False, False, True, False, True]
    mapper.close()


def test_nothing_is_printed(mapped, capfd):
    mapper, _, _ = mapped(laps=0.3)
    mapper.finish()
    mapper.occupancy()
    mapper.close()
    assert capfd.readouterr() == ("", "")


def test_entropy_is_of_weights_not_of_their_logarithms(mapped):
    mapper, _, _ = mapped(laps=0.3, particles=12, resampleThreshold=0.0)
    weights = mapper.filter.weights
    assert mapper.entropy == pytest.approx(-np.sum(weights * np.log(weights)))
    assert 0.0 < mapper.entropy <= math.log(12)
    mapper.close()


def test_scans_and_tiles_do_not_pile_up_while_the_robot_goes_to_and_fro(laser, ring):
    """Matching alone keeps nothing; what is registered again and again costs no further tiles."""
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 4, "linearUpdate": 100.0, "angularUpdate": 100.0}), laser)
    truth = drive(0.1)
    for k in range(120):
        pose = truth[k % 4]
        mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), pose, 0.1 * k)
    assert len(mapper.readings) == 1 and len(mapper.filter.tree) == 4
    assert mapper.filter.maps.tiles_in_use < 4 * 400
    mapper.close()


def test_ten_thousand_particles_map():
    few = LaserModel.from_message(-1.0, 1.0, 0.25, 9, 0.1, 10.0)
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 10000, "linearUpdate": 0.1}), few)
    for k in range(3):
        mapper.process(mapper.reading(2.0 - 0.12 * k + np.zeros(9)), [0.12 * k, 0.0, 0.0], float(k))
    assert mapper.processed == 3 and abs(mapper.pose[0] - 0.24) < 0.05
    mapper.close()


def test_one_particle_maps(mapped):
    mapper, truth, _ = mapped(laps=0.3, particles=1)
    assert mapper.entropy == 0.0 and mapper.filter.n_eff == 1.0 and mapper.processed > 5
    mapper.close()


def test_a_run_with_odometry_that_stands_still_keeps_to_the_walls(ring, laser):
    """Wheels that slip wholly: odometry says nothing has moved."""
    truth = drive(0.15)[:10]
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 5, "temporalUpdate": 0.0}), laser)
    for k, pose in enumerate(truth):
        mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), np.zeros(3), 0.1 * k)
        assert np.isfinite(mapper.pose).all()
    mapper.close()


# ---- the way in

@pytest.mark.parametrize("prefix, given, wanted", [
    ("", {}, ("base_link", "odom", "map")), ("r1", {}, ("r1/base_link", "r1/odom", "r1/map")),
    ("r1", {"odom_frame": "/odom", "map_frame": "r1/map"}, ("r1/base_link", "odom", "r1/map")),
    ("a/b", {"base_frame": "a/b/foot"}, ("a/b/foot", "a/b/odom", "a/b/map"))])
def test_frames_are_resolved_with_the_prefix(prefix, given, wanted):
    config = with_prefix(GmappingConfig.from_mapping(given), prefix)
    assert (config["base_frame"], config["odom_frame"], config["map_frame"]) == wanted


@pytest.mark.parametrize("value, wanted", [("/r1/", "r1"), ("r1", "r1"), ("", ""), (3, "")])
def test_the_prefix_is_searched_upwards(monkeypatch, value, wanted):
    monkeypatch.setattr(rospy, "search_param", lambda name: "/robots/" + name)
    monkeypatch.setattr(rospy, "get_param", lambda name: {"/robots/tf_prefix": value}[name])
    assert tf_prefix() == wanted
    monkeypatch.setattr(rospy, "search_param", lambda name: None)
    assert tf_prefix() == ""


def test_odometry_of_another_kind_of_number_is_taken(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2}), laser)
    odom = odometry(drive(0.1), np.random.default_rng(0)).astype(np.float32)
    reading = mapper.reading(tuple(ring.ranges(drive(0.1)[0], laser.angles)))
    assert mapper.process(reading, list(odom[0]), 0).processed
    mapper.close()


def test_memory_stays_flat_while_the_robot_stands_still(ring, laser):
    """Two thousand scans, a map of each hundredth."""
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=5, linearUpdate=0.3)), laser)
    truth, rng, held = drive(0.2), np.random.default_rng(2), []
    tracemalloc.start()
    try:
        for k in range(len(truth) + 2000):
            if k < len(truth):
                pose, ranges = truth[k], ring.ranges(truth[k], laser.angles)
            mapper.process(mapper.reading(ranges + rng.normal(0.0, 0.01, len(ranges))), pose, 0.1 * k)
            if k % 100 == 0:
                mapper.map_of(*mapper.map_request())
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
        mapper.close()
    assert mapper.processed > 5
    assert max(held[3:]) - held[2] < 20000


# ---- the way out

class Outlet:
    """In the place of publishers and services; keeps what is published."""

    sent = []

    def __init__(self, name, *_, **__):
        self._name = name

    def publish(self, message):
        Outlet.sent.append((self._name, message))


class SlowMapper:
    """A mapper whose maps take as long as the test wants."""

    entropy, given = 0.0, 0

    def __init__(self):
        self.go, self.begun, self.asked, self.stamps = threading.Semaphore(0), threading.Semaphore(0), 0, []

    def map_request(self):
        self.asked += 1
        self.stamps.append(float(self.asked))
        return np.full((self.asked, 3), float(self.asked)), []

    def map_of(self, path, readings):
        self.begun.release()
        assert self.go.acquire(timeout=60)
        return Grid(np.full((32, 32), len(path), np.int8), 0.05, np.zeros(2))

    @staticmethod
    def base_poses(poses):
        return poses


def test_a_map_in_the_making_holds_up_no_scan_and_only_the_newest_waits(monkeypatch):
    """The original builds the map in the scan's callback, from the first scan on."""
    monkeypatch.setattr(Outlet, "sent", [])
    monkeypatch.setattr(rospy, "Publisher", Outlet)
    monkeypatch.setattr(rospy, "Service", Outlet)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1))
    output, mapper = MapOutput("map"), SlowMapper()
    output.ask(mapper)
    assert mapper.begun.acquire(timeout=60)
    for _ in range(5):
        output.ask(mapper)              # would wait for ever if the map were made here
    assert output.made == 0 and mapper.asked == 6
    mapper.go.release(2)
    assert mapper.begun.acquire(timeout=60)
    output.close()
    maps = [message for name, message in Outlet.sent if name == "map"]
    assert [int(message.data[0]) for message in maps] == [1, 6]
    paths = [message for name, message in Outlet.sent if name == "~path"]
    assert [len(message.plane) for message in paths] == [1, 6]


def test_what_is_missing_at_the_start_is_named(monkeypatch):
    told, naps = [], iter([False] * 3 + [True] * 100)

    class Nothing:
        arrived = 0
    monkeypatch.setattr(rospy.rostime, "wallsleep", lambda _: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: next(naps))
    monkeypatch.setattr(rospy, "get_published_topics", lambda: [["/front/scan", "sensor_msgs/LaserScan"], ["/x", "y"]])
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: told.append(text % values))
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy, "get_time", lambda: 0.0)
    name_what_is_missing(Nothing(), "/robot/scan")
    assert "/clock" in told[0] and "use_sim_time" in told[0]
    assert "/robot/scan" in told[1] and "/front/scan" in told[1]


def test_a_clock_that_is_missing_is_named_even_where_scans_come(monkeypatch):
    told, clock = [], iter([0.0, 0.0, 5.0])

    class Scans:
        arrived = 7
    monkeypatch.setattr(rospy.rostime, "wallsleep", lambda _: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: told.append(text % values))
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy, "get_time", lambda: next(clock))
    name_what_is_missing(Scans(), "/scan")
    assert len(told) == 2 and "/clock" in told[0]
