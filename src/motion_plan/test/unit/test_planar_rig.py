# SPDX-License-Identifier: BSD-3-Clause
"""The rig itself, compared with closed forms."""
import math

import numpy as np
import pytest

from planar_rig import ANGLE_MIN, BEAMS, INCREMENT, STEP, Robot, World, cast_rays


def ranges(world, x=0.0, y=0.0, yaw=0.0):
    boxes, _, discs = world.arrays()
    out = np.empty(BEAMS)
    cast_rays(x, y, yaw, boxes, discs, out)
    return out


def test_wall_ahead_reads_distance_over_cosine():
    angles = ANGLE_MIN + INCREMENT * np.arange(BEAMS)
    near = np.abs(angles) < 1.0
    assert ranges(World().box(2.1, 0, 0.2, 100))[near] == pytest.approx(2.0 / np.cos(angles[near]))


def test_turned_box_and_disc():
    middle = ranges(World().box(3.0, 0.0, 1.0, 1.0, math.pi / 4))[359:361].min()
    assert middle == pytest.approx(3.0 - math.sqrt(0.5), abs=0.01)
    assert ranges(World().disc(2.0, 0.0, 0.5))[359:361].min() == pytest.approx(1.5, abs=1e-4)


def test_the_caster_is_the_first_to_reach_a_wall():
    robot = Robot(World().box(1.1, 0, 0.2, 4), (0, 0), 0.0, np.random.default_rng(0))
    assert robot.clearance() == pytest.approx(0.6, abs=1e-3)
    robot.pose = (0.7, 0, 0.0)
    assert robot.clearance() < 0.0


def test_stopping_from_half_a_metre_per_second_takes_a_seventh():
    robot = Robot(World(), (0, 0), 0.0, np.random.default_rng(0))
    robot.command = (0.5, 0.0)
    robot.take_command()
    for _ in range(100):
        robot.step()
    assert robot.speed[0] == 0.5
    robot.command = (0.0, 0.0)
    robot.take_command()
    count = 0
    while robot.speed[0] > 0:
        robot.step()
        count += 1
    assert count * STEP == pytest.approx(0.15, abs=0.02)
