# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles that move are told from those that stand, with their velocities."""
import math
from dataclasses import replace

import numpy as np
import pytest

from m2wr_navigation.methods import moving, moving_kernels
from m2wr_navigation.methods.body import M2WR
from m2wr_navigation.methods.method import Sensing
from m2wr_navigation.methods.moving import MovingObstacles
from m2wr_navigation.methods.scan_points import scan_points

BODY = replace(M2WR, own_parts=(), laser=(0.0, 0.0, 0.0))
BEAMS, PERIOD, REACH = 720, 0.05, 6.0
WALL = 5.0          # m: a wall to the right
ANGLES = -math.pi + 2.0 * math.pi / BEAMS * np.arange(BEAMS)


def ranges_of(discs, pose=(0.0, 0.0, 0.0), wall=True, angles=ANGLES):
    """Return the readings of a scan of discs (x, y, radius) and of a wall at y = -WALL."""
    across, up = np.cos(angles + pose[2]), np.sin(angles + pose[2])
    with np.errstate(divide="ignore"):
        found = np.where(up < 0.0, (WALL + pose[1]) / -up, np.inf) if wall else np.full(len(angles), np.inf)
    for x, y, radius in discs:
        ahead = (x - pose[0]) * across + (y - pose[1]) * up
        depth = radius ** 2 - (x - pose[0]) ** 2 - (y - pose[1]) ** 2 + ahead ** 2
        with np.errstate(invalid="ignore"):
            found = np.minimum(found, np.where((depth > 0.0) & (ahead > 0.0), ahead - np.sqrt(depth), np.inf))
    return found


def watched(discs_at, seconds, pose_at=lambda time: (0.0, 0.0, 0.0), noise=0.01, found=None, since=0.0, **given):
    """Return what follows obstacles after a time, and which points of the last scan move."""
    found = MovingObstacles(2.8, 0.09) if found is None else found
    random, marked = np.random.default_rng(1), None
    for k in range(1, 1 + int(round(seconds / PERIOD))):
        time = since + k * PERIOD
        ranges = ranges_of(discs_at(time), pose_at(time), **given) + noise * random.standard_normal(BEAMS)
        marked = found.update(scan_points(Sensing(time, pose_at(time), (0.0, 0.0), ranges, -math.pi,
                                                  2.0 * math.pi / BEAMS), BODY, REACH))
    return found, marked


@pytest.mark.parametrize("velocity", [(-0.4, 0.0), (0.0, 0.3), (-0.2, -0.2), (0.0, -1.0)])
def test_a_disc_that_moves_is_found_with_its_velocity(velocity):
    discs_at = lambda time: [(3.0 + velocity[0] * time, 0.5 + velocity[1] * time, 0.25), (2.0, -2.0, 0.3)]  # noqa: E731
    found, marked = watched(discs_at, 2.5)
    (x, y, v_x, v_y, radius), = found.moving
    assert (x, y) == pytest.approx(discs_at(2.5)[0][:2], abs=0.1)
    assert (v_x, v_y) == pytest.approx(velocity, abs=0.12) and radius == pytest.approx(0.25, abs=0.08)
    assert 5 < marked.sum() < 120


def test_nothing_moves_for_a_robot_that_drives_among_pillars():
    random = np.random.default_rng(4)
    pillars = [(*random.uniform((0.5, -4.5), (8.0, 4.5)), random.uniform(0.05, 0.4)) for _ in range(30)]
    pillars = [(x, y, radius) for x, y, radius in pillars if abs(y) > radius + 0.4]
    pose_at = lambda time: (0.5 * time, 0.2 * math.sin(0.7 * time), 0.8 * math.sin(time))        # noqa: E731
    found, marked = watched(lambda time: pillars, 14.0, pose_at)
    assert len(found.moving) == 0 and not marked.any()


def test_what_stops_is_followed_and_what_is_gone_is_dropped():
    found, _ = watched(lambda time: [(3.0, 0.4 * time - 1.0, 0.25)], 2.5)
    found, _ = watched(lambda time: [(3.0, 0.0, 0.25)], 2.0, found=found, since=2.5)
    (_, _, v_x, v_y, _), = found.moving
    assert math.hypot(v_x, v_y) < 0.1
    found, _ = watched(lambda time: [], PERIOD, found=found, since=4.5)        # a beam passes where it was
    assert len(found.moving) == 0


def test_what_stands_for_long_stands():
    found, _ = watched(lambda time: [(3.0, 0.4 * min(time, 2.5) - 1.0, 0.25)], 7.0)
    assert len(found.moving) == 0


def test_what_is_hidden_is_expected_to_continue():
    crossing = lambda time: [(3.0, 0.4 * time - 1.0, 0.25)]         # noqa: E731
    found, _ = watched(crossing, 2.0)
    hidden = lambda time: crossing(time) + [(1.0, -0.1, 0.4)]        # noqa: E731
    found, _ = watched(hidden, 1.0, found=found, since=2.0)
    near = [row for row in found.moving if row[0] > 2.0]
    assert near[0][:2] == pytest.approx(crossing(3.0)[0][:2], abs=0.2)
    found.update(scan_points(Sensing(30.0, (0.0, 0.0, 0.0), (0.0, 0.0), ranges_of([]), -math.pi,
                                     2.0 * math.pi / BEAMS), BODY, REACH))
    assert len(found.moving) == 0           # after a gap in time nothing is known


def test_many_groups_and_odd_scans_are_bounded():
    found = MovingObstacles(2.8, 0.09)
    spikes = np.where(np.arange(BEAMS) % 6 < 3, 2.0, 4.0)
    for k, (ranges, step) in enumerate([(spikes, 0.01), (np.full(BEAMS, np.nan), 0.01), (np.zeros(BEAMS), 0.01),
                                        (spikes, 0.0), (spikes, -0.01), (np.full(1, 1.0), 0.0)]):
        scan = scan_points(Sensing(0.1 * k, (0.0, 0.0, 0.0), (0.0, 0.0), ranges, -math.pi, step), BODY, REACH)
        assert found.update(scan).shape == scan.hits.shape
        assert len(found._tracks) <= moving.MOST


@pytest.mark.parametrize("increment", [0.01, -0.01])
def test_a_place_is_found_among_the_beams(increment):
    laser, first = np.array([1.0, 2.0, 0.3]), -0.5 if increment > 0.0 else 0.5
    angle = 0.3 + first + 17 * increment
    x, y = 1.0 + 3.0 * math.cos(angle), 2.0 + 3.0 * math.sin(angle)
    assert moving_kernels.beam_at(x, y, laser, first, increment, 100) == 17
    assert moving_kernels.beam_at(x, y, laser, first, increment, 10) == -1


def test_the_middle_of_a_circle_is_found_from_an_arc():
    angles = math.pi + np.linspace(-0.6, 0.6, 20)
    arc = np.column_stack([2.0 + 0.3 * np.cos(angles), 1.0 + 0.3 * np.sin(angles)])
    assert moving_kernels.circle_through(arc, 2.05, 1.02, 0.3) == pytest.approx((2.0, 1.0), abs=0.02)
