"""What the original does wrong and its users know: none of it here. Lasers and bad input have tests of their own."""
import math
import threading
import time

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import LaserScan

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.occupancy import Occupancy
from m2wr_gmapping.ros.intake import Intake
from m2wr_gmapping.ros.params import tf_prefix, with_prefix
from m2wr_gmapping.scan import LaserModel


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

class FakeTime:
    """A clock that goes on with every look at it, and lets other threads in between."""

    def __init__(self):
        self._lock, self._ticks = threading.Lock(), 0

    def now(self):
        with self._lock:
            self._ticks += 1
            found = rospy.Time(0, 1000 * self._ticks)
        time.sleep(0)
        return found


def test_threads_that_look_at_the_clock_together_see_no_jump(monkeypatch):
    clock = FakeTime()
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy.Time, "now", clock.now)
    intake = Intake("odom", 10)

    def bring(count):
        for _ in range(count):
            intake._look_at_clock()

    threads = [threading.Thread(target=bring, args=(2000,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert intake.generation == 0


def test_a_clock_that_goes_back_is_a_jump(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    intake = Intake("odom", 10)
    for seconds, generation in ((10.0, 0), (11.0, 0), (11.0, 0), (10.5, 1), (10.6, 1)):
        monkeypatch.setattr(rospy.Time, "now", lambda seconds=seconds: rospy.Time.from_sec(seconds))
        scan = LaserScan()
        scan.header.stamp = rospy.Time.from_sec(seconds)
        intake.on_scan(scan)
        assert intake.generation == generation


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
