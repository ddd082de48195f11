# SPDX-License-Identifier: BSD-3-Clause
"""Which commands robots may take."""
import numpy as np
import pytest

from m2wr_exploration.team.right_of_way import BRAKES, CLEARANCE, allowed, sweep
from m2wr_exploration.team.sweep_kernels import least_gap

OUTLINE = np.array([(-0.27, -0.25), (0.41, -0.25), (0.41, 0.25), (-0.27, 0.25)])
PERIOD = 0.1


def drive(poses, wanted, steps):
    """Return the least gap between any two of some robots that all take the allowed part of a wish."""
    poses, velocities = [np.array(pose, float) for pose in poses], [np.zeros(2) for _ in poses]
    least = np.inf
    for _ in range(steps):
        commands = allowed(poses, velocities, wanted(poses), OUTLINE, PERIOD)
        for number, command in enumerate(commands):
            reach = BRAKES * PERIOD
            velocities[number] = velocities[number] + np.clip(np.array(command) - velocities[number], -reach, reach)
            forward, turn = velocities[number] * PERIOD
            x, y, yaw = poses[number]
            poses[number] = np.array([x + forward * np.cos(yaw + 0.5 * turn), y + forward * np.sin(yaw + 0.5 * turn),
                                      yaw + turn])
        least = min([least] + [least_gap(poses[one][None], poses[other][None], OUTLINE, 9.0)
                               for one in range(len(poses)) for other in range(one)])
    return least, poses


def test_robots_that_are_alone_or_far_apart_take_what_they_want():
    assert allowed([np.zeros(3)], [np.zeros(2)], [(0.5, 0.1)], OUTLINE, PERIOD) == [(0.5, 0.1)]
    poses = [np.zeros(3), np.array([9.0, 0.0, np.pi])]
    assert allowed(poses, [np.zeros(2)] * 2, [(0.5, 0.1)] * 2, OUTLINE, PERIOD) == [(0.5, 0.1)] * 2


def test_of_two_that_meet_the_first_continues_the_other_stops():
    moving = [np.array([0.5, 0.0])] * 2
    apart = [np.zeros(3), np.array([0.82 + CLEARANCE + 2.0 * (0.05 + 0.125) + 0.05, 0.0, np.pi])]
    # room for the first one to begin to slow down a period later, none for both
    assert allowed(apart, moving, [(0.5, 0.0)] * 2, OUTLINE, PERIOD)[0] == (0.5, 0.0)
    near = [np.zeros(3), np.array([0.82 + CLEARANCE + 0.01, 0.0, np.pi])]
    still = [np.zeros(2)] * 2
    assert allowed(near, still, [(0.5, 0.0)] * 2, OUTLINE, PERIOD) == [(0.0, 0.0)] * 2


def test_a_robot_that_faces_another_one_may_turn_away():
    poses = [np.zeros(3), np.array([0.41 + 0.27 + CLEARANCE + 0.018, 0.0, 0.0])]
    still = [np.zeros(2)] * 2
    assert allowed(poses, still, [(0.5, 0.0), (0.0, 0.0)], OUTLINE, PERIOD)[0] == (0.0, 0.0)
    assert allowed(poses, still, [(0.5, -0.4), (0.0, 0.0)], OUTLINE, PERIOD)[0] == (0.0, -0.4)


def test_two_that_are_too_near_may_part():
    poses = [np.zeros(3), np.array([0.82 + 0.5 * CLEARANCE, 0.0, np.pi])]
    found = allowed(poses, [np.zeros(2)] * 2, [(-0.15, 0.0), (0.15, 0.0)], OUTLINE, PERIOD)
    assert found == [(-0.15, 0.0), (0.0, 0.0)]


def test_head_on_robots_stop_apart():
    least, poses = drive([(0.0, 0.0, 0.0), (5.0, 0.0, np.pi)], lambda _: [(0.5, 0.0)] * 2, 100)
    assert CLEARANCE - 0.01 <= least < CLEARANCE + 0.2
    assert poses[1][0] > poses[0][0]


@pytest.mark.parametrize("seed", range(4))
def test_robots_that_drive_at_random_never_collide(seed):
    rng = np.random.default_rng(seed)
    places = [(1.2 * column, 1.2 * row, rng.uniform(-3.0, 3.0)) for row in range(2) for column in range(3)]
    middle = np.mean(np.array(places)[:, :2], axis=0)

    def wanted(poses):                                      # to the middle, all of them, with random turns
        found = []
        for x, y, yaw in poses:
            aim = np.arctan2(middle[1] - y, middle[0] - x) - yaw + rng.normal(0.0, 1.0)
            found.append((float(rng.choice([0.5, 0.5, -0.15])), float(np.clip(np.remainder(
                aim + np.pi, 2 * np.pi) - np.pi, -0.8, 0.8))))
        return found

    assert drive(places, wanted, 150)[0] > 0.05


def test_sweep_keeps_the_velocity_that_the_robot_has():
    made = sweep(np.zeros(3), np.array([0.5, 0.0]), (0.0, 0.0), PERIOD)
    assert made[:, 0].max() == pytest.approx(0.175, abs=0.01)
