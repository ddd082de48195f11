# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from motion_plan.pose_history import PoseHistory
from motion_plan.surroundings import Surroundings
from motion_plan.wall_guard import drive, footprint_clearance
from planar_rig import ANGLE_MIN, INCREMENT, Robot, World, clearance, outline_points


def scanned(world, pose, around=None):
    around = around or Surroundings()
    around.update(Robot(world, pose[:2], pose[2], np.random.default_rng(0)).scan(), ANGLE_MIN, INCREMENT, pose)
    return around


def test_points_lie_on_the_wall():
    around = scanned(World().box(2.0, 0.0, 0.2, 4.0), (0.0, 0.0, 0.0))
    assert len(around.points) > 20
    assert np.abs(around.points[:, 0] - 1.9).max() < 0.06


def test_hidden_points_are_kept_and_cleared_ones_removed():
    world = World().disc(1.5, 0.0, 0.2)
    around = scanned(world, (0.0, 0.0, 0.0))
    scanned(world, (0.0, 0.0, math.pi), around)
    assert around.nearest(1.3, 0.0)[0] < 0.1
    scanned(World(), (0.0, 0.0, 0.0), around)
    assert len(around.points) == 0


def test_hidden_points_are_kept():
    around = scanned(World().disc(2.0, 0.0, 0.3), (0.0, 0.0, 0.0))
    scanned(World().disc(1.0, 0.0, 0.4), (0.0, 0.0, 0.0), around)
    assert around.nearest(1.7, 0.0)[0] < 0.1


def test_teleport_forgets():
    around = scanned(World().disc(1.0, 0.0, 0.2), (0.0, 0.0, math.pi))
    around.points = np.array([[1.0, 0.0]])
    scanned(World(), (1.0, 2.0, math.pi / 2), around)
    assert len(around.points) == 0


def test_invalid_readings_are_ignored():
    ranges = np.full(720, np.nan)
    ranges[360], ranges[361] = -np.inf, np.inf
    around = Surroundings()
    around.update(ranges, ANGLE_MIN, INCREMENT, (0.0, 0.0, 0.0))
    assert len(around.points) == 1 and around.points[0, 0] == pytest.approx(0.25, abs=0.01)


def test_free_travel_to_a_point():
    around = Surroundings()
    around.points = np.array([[2.0, 0.3]])
    travel, blocker = around.free_travel(0.0, 0.0, [0.0, 0.5, math.pi], 0.5)
    assert travel[0] == pytest.approx(2.0 - 0.4) and blocker[0] == 0
    assert math.isinf(travel[2]) and blocker[2] == -1


def test_point_inside_the_disc_blocks_the_approach_only():
    around = Surroundings()
    around.points = np.array([[0.3, 0.0]])
    travel, _ = around.free_travel(0.0, 0.0, np.radians([0, 80, 100, 180]), 0.5)
    assert list(travel[:2]) == [0.0, 0.0] and np.isinf(travel[2:]).all()


def test_the_first_free_direction_equals_that_of_free_travel():
    rng, outcomes = np.random.default_rng(6), set()
    for count in list(range(0, 60)) * 8:
        around = Surroundings()
        around.points = rng.uniform(-2.0, 2.0, (count, 2))
        x, y = rng.uniform(-0.5, 0.5, 2)
        radius, distance = rng.uniform(0.1, 0.6), rng.uniform(0.1, 1.5)
        directions = rng.uniform(-4.0, 4.0) + np.radians(np.arange(0.0, 360.0, 3.0))
        travel, blockers = around.free_travel(x, y, directions, radius)
        free = np.flatnonzero(travel >= distance)
        first, blocker = around.first_free(x, y, directions, radius, distance)
        assert first == (free[0] if len(free) else -1)
        if first > 0:
            assert blocker == blockers[first - 1]
        outcomes.add(min(first, 1))
        outcomes.add('late' if first > 30 else 'early')
    assert outcomes == {-1, 0, 1, 'early', 'late'}      # all cases occurred


def test_footprint_clearance_agrees_with_the_rig():
    rng = np.random.default_rng(5)
    outline = outline_points(0.005)
    for _ in range(200):
        pose = (rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(-3, 3))
        point = rng.uniform(-1.5, 1.5, 2)
        ours = footprint_clearance(point[None, :], pose)
        if ours > 0.01:
            disc = np.array([[point[0], point[1], 0.0]])
            true = clearance(outline, pose[0], pose[1], pose[2], np.empty((0, 5)), disc)
            assert true == pytest.approx(ours, abs=0.003)


def test_turning_on_the_spot_keeps_the_axle():
    x, y, yaw = drive((1.0, 2.0, 0.0), 0.0, 1.0, math.pi / 2)
    assert (x, y, yaw) == pytest.approx((0.95, 2.05, math.pi / 2))


def test_pose_history_interpolates_across_pi():
    history = PoseHistory()
    history.add(1.0, (0.0, 0.0, 3.0))
    history.add(2.0, (1.0, 0.0, -3.0))
    x, _, yaw = history.at(1.5)
    assert x == 0.5 and abs(abs(yaw) - math.pi) < 1e-9
    assert history.at(0.0) == (0.0, 0.0, 3.0) and history.at(9.0) == (1.0, 0.0, -3.0)


def test_pose_history_restarts_when_time_jumps_back():
    history = PoseHistory()
    assert history.at(1.0) is None
    history.add(5.0, (1.0, 1.0, 0.0))
    history.add(0.1, (2.0, 2.0, 0.0))
    assert history.at(5.0) == (2.0, 2.0, 0.0)


def test_a_360_degree_scanner_does_not_store_the_own_wheels():
    increment = 2.0 * math.pi / 720
    angles = np.arange(720) * increment - math.pi
    ranges = np.full(720, np.inf)
    wheels = np.abs(np.abs(angles) - math.radians(140)) < math.radians(3)     # their direction, seen from the laser
    ranges[wheels] = math.hypot(-0.05 - 0.15, 0.18)
    ranges[360] = 1.0
    around = Surroundings()
    around.update(ranges, -math.pi, increment, (1.0, 2.0, 0.7))
    assert around.nearest(*(1.0 + 1.15 * math.cos(0.7), 2.0 + 1.15 * math.sin(0.7)))[0] < 0.05
    assert len(around.points) == 1


def test_an_obstacle_a_hand_beside_the_wheel_is_stored():
    ranges = np.full(720, np.inf)
    ranges[0] = math.hypot(0.2, 0.32)
    around = Surroundings()
    around.update(ranges, math.atan2(0.32, -0.2), 0.001, (0.0, 0.0, 0.0))
    assert around.nearest(-0.05, 0.32)[0] < 1e-6
