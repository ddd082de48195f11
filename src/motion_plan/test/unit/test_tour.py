# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest

from motion_plan.tour import PATIENCE, REACHED, Tour, TourError


def drive(tour, pose, seconds, step=0.05, factor=1.0):
    """Let an ideal robot follow the commands; returns its poses. ``factor``: slip of the floor."""
    poses = [pose]
    for k in range(int(seconds / step)):
        x, y, yaw = poses[-1]
        linear, angular = tour.update(k * step, poses[-1])
        middle = yaw + 0.5 * step * angular
        poses.append((x + factor * step * linear * math.cos(middle), y + factor * step * linear * math.sin(middle),
                      yaw + factor * step * angular))
        if tour.finished or tour.stuck:
            break
    return poses


def test_all_points_are_visited_in_their_order():
    points = [(3.0, 0.0), (3.0, 2.0), (-1.0, 2.0), (-1.0, -1.0), (3.0, 0.0)]
    tour = Tour(points)
    poses = drive(tour, (0.0, 0.0, 2.0), 200.0)
    assert tour.finished and not tour.stuck
    at = [min((k for k, pose in enumerate(poses) if math.hypot(pose[0] - x, pose[1] - y) <= REACHED), default=None)
          for x, y in points]
    assert None not in at and at[:4] == sorted(at[:4])
    assert tour.update(999.0, poses[-1]) == (0.0, 0.0)


def test_the_path_between_two_points_is_nearly_straight():
    poses = drive(Tour([(5.0, 0.0)]), (0.0, 0.0, 0.3), 60.0)
    assert max(abs(y) for _, y, _ in poses) < 0.25


def test_a_turn_is_to_the_nearer_side_and_on_the_spot():
    assert Tour([(0.0, 5.0)]).update(0.0, (0.0, 0.0, 0.0)) == (0.0, 0.7)
    assert Tour([(0.0, -5.0)]).update(0.0, (0.0, 0.0, 0.0)) == (0.0, -0.7)
    assert Tour([(-5.0, 0.01)]).update(0.0, (0.0, 0.0, math.pi)) == pytest.approx((0.5, -0.003), abs=1e-3)


def test_a_point_where_the_robot_stands_is_passed_at_once():
    tour = Tour([(0.0, 0.0), (0.1, 0.0), (5.0, 0.0)])
    linear, _ = tour.update(0.0, (0.0, 0.0, 0.0))
    assert tour.index == 2 and linear == 0.5


@pytest.mark.parametrize('turned', [0.0, 2.0])
def test_a_robot_without_progress_is_stuck_and_stops(turned, caplog):
    tour = Tour([(5.0, 0.0)])
    poses = drive(tour, (0.0, 0.0, turned), 60.0, factor=0.0)
    assert tour.stuck and not tour.finished
    assert PATIENCE <= 0.05 * len(poses) < PATIENCE + 2.0
    assert tour.update(60.0, (0.0, 0.0, turned)) == (0.0, 0.0) and 'no nearer to way point 1' in caplog.text


def test_a_long_rotation_and_slip_do_not_count_as_stuck():
    tour = Tour([(4.0, 0.0), (-4.0, 0.0)])
    drive(tour, (0.0, 0.0, math.pi), 400.0, factor=0.2)
    assert tour.finished


def test_restart_begins_with_the_first_point():
    tour = Tour([(1.0, 0.0), (2.0, 0.0)])
    tour.update(0.0, (1.0, 0.0, 0.0))
    tour.restart()
    assert tour.index == 0


@pytest.mark.parametrize('points, speed', [([], 0.5), (None, 0.5), ([(1.0,)], 0.5), ([(1.0, 'far')], 0.5),
                                           ([(1.0, math.nan)], 0.5), ([(1.0, 2.0)], 0.0), ([(1.0, 2.0)], math.inf),
                                           ([(1.0, 2.0)], 'fast'),
                                           ([(10**400, 2.0)], 0.5), ([(1.0, 2.0)], 10**400), ([(1.0, 2.0)], None)])
def test_invalid_tours_are_refused(points, speed):
    with pytest.raises(TourError, match='expected'):
        Tour(points, speed)
