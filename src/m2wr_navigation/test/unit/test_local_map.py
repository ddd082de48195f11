# SPDX-License-Identifier: BSD-3-Clause
"""The map of what was seen keeps obstacles, clears them, moves with the robot, and knows the way round them."""
import math
from dataclasses import replace

import numpy as np
import pytest

from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.methods.body import M2WR
from m2wr_navigation.methods.local_map import LocalMap
from m2wr_navigation.methods.method import Sensing
from m2wr_navigation.methods.mppi import discs_of
from m2wr_navigation.methods.mppi_kernels import RolloutSettings, clearance_of, cost_of, reached, sample
from m2wr_navigation.methods.scan_points import scan_points
from m2wr_view.outlines import Outline, point_distances

BODY = replace(M2WR, own_parts=(), laser=(0.0, 0.0, 0.0))
SETTINGS = RolloutSettings(0.05, -0.1, 0.5, 1.0, 0.1, 0.25, 2.0, 0.2, 0.4, 0.04, 0.25, 2.0, 0.02, 1.0, 0.0, 0.1)


def scan(ranges, pose=(0.0, 0.0, 0.0)):
    sensing = Sensing(0.0, pose, (0.0, 0.0), np.asarray(ranges, float), -math.pi, 2.0 * math.pi / len(ranges))
    return scan_points(sensing, BODY, 6.0)


def wall_ahead(distance=2.0, half=1.0):
    """Return a scan of a wall across the way, 2 half wide."""
    angles = -math.pi + 2.0 * math.pi / 720 * np.arange(720)
    with np.errstate(divide="ignore"):
        ranges = distance / np.maximum(np.cos(angles), 0.0)
    return scan(np.where(np.abs(ranges * np.sin(angles)) <= half, ranges, np.inf))


def made(**given):
    return LocalMap(BODY, **dict({"side": 10.0, "resolution": 0.05, "reach": 6.0, "clearance": 1.0}, **given))


def obstacles(found):
    return found.grid.origin + (np.argwhere(found.grid.costs == LETHAL)[:, ::-1] + 0.5) * found.grid.resolution


def test_obstacles_stay_when_they_are_out_of_sight():
    found = made()
    found.look(wall_ahead())
    before = len(obstacles(found))
    assert before > 30 and np.abs(obstacles(found)[:, 0] - 2.0).max() < 0.06
    found.look(scan(np.full(720, np.nan)))
    assert len(obstacles(found)) == before
    found.look(scan(np.full(720, np.inf)))          # beams pass where it was
    assert len(obstacles(found)) < 0.1 * before


def test_the_map_moves_with_the_robot_and_keeps_its_content():
    found = made()
    found.look(wall_ahead())
    place = obstacles(found).mean(axis=0)
    found.look(scan(np.full(720, np.nan), (4.0, 0.0, 0.0)))
    assert found.grid.origin[0] > -3.0 and obstacles(found).mean(axis=0) == pytest.approx(place, abs=1e-6)
    found.look(scan(np.full(720, np.nan), (1e6, 0.0, 0.0)))         # a teleport
    assert len(obstacles(found)) == 0


def test_the_way_to_the_goal_leads_round_a_wall():
    found = made()
    found.aim((4.0, 0.0))
    found.look(wall_ahead(half=1.5))
    found.aim((4.0, 0.0))
    assert sample(found.to_goal, found.corner, 0.0, 0.0, 2.0) > math.hypot(2.0, 1.5) * 2.0 - 0.2
    assert sample(found.to_goal, found.corner, 4.0, 0.0, 2.0) < 0.2
    assert sample(found.to_goal, found.corner, 3.0, 0.0, 2.0) < 2.5


def test_a_goal_outside_of_the_map_is_aimed_at():
    found = made()
    found.look(scan(np.full(720, np.inf)))
    found.aim((40.0, 0.0))
    assert sample(found.to_goal, found.corner, 0.0, 0.0, 2.0) == pytest.approx(40.0, abs=0.5)
    found.aim((1e300, -1e300))
    assert np.isfinite(found.to_goal).all()


def test_discs_cover_the_robot_closely():
    discs = discs_of(M2WR)
    angles = np.linspace(0.0, 2.0 * math.pi, 400)
    hull = Outline(M2WR.hull - (M2WR.axle_x, 0.0), 0.0)
    shares = np.linspace(0.0, 1.0, 50)[:, None, None]
    rim = (shares * hull.vertices + (1.0 - shares) * np.roll(hull.vertices, 1, axis=0)).reshape(-1, 2)
    for covered in (discs[:1], discs[1:]):
        assert (np.min([np.hypot(*(rim - disc[:2]).T) - disc[2] for disc in covered], axis=0) <= 1e-9).all()
    for x, y, radius in discs[1:]:
        rim = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles)], -1)
        assert point_distances(rim, hull).max() < 0.12        # its front is narrow


def test_clearance_is_of_the_outline_not_of_the_turning_disc():
    distance = np.full((100, 100), 5.0, np.float32)
    corner = np.array([-2.5, -2.5, 0.05])
    centres = (np.stack(np.meshgrid(np.arange(100), np.arange(100)), -1) + 0.5) * 0.05 - 2.5
    distance[:] = np.hypot(centres[..., 0], centres[..., 1] - 0.4)
    beside = clearance_of(distance, corner, discs_of(M2WR), 0.0, 0.0, 0.0, 1.0)
    across = clearance_of(distance, corner, discs_of(M2WR), 0.0, 0.0, 0.5 * math.pi, 1.0)
    assert 0.1 < beside < 0.2 and across < 0.0 and M2WR.turning_radius > 0.4


def test_velocities_change_as_fast_as_the_robot_can():
    assert reached(0.0, 0.0, 0.5, 1.0, SETTINGS) == pytest.approx((0.1, 0.25))
    fast = SETTINGS._replace(most_v=2.0, change_v=9.0, change_w=9.0)
    assert reached(2.0, 0.0, 2.0, 5.0, fast) == pytest.approx((2.0, 1.0))


def test_a_collision_costs_more_than_any_way_round():
    distance, to_goal = np.full((100, 100), 5.0, np.float32), np.full((50, 50), 30.0, np.float32)
    corner, state = np.array([-2.5, -2.5, 0.05]), np.array([0.0, 0.0, 0.0, 0.5, 0.0])
    ahead, calm = np.tile((0.5, 0.0), (20, 1)), np.zeros((2, 2), np.float32)
    free = cost_of(distance, to_goal, corner, discs_of(M2WR), np.zeros((0, 5)), state, ahead, calm, SETTINGS)
    assert free == pytest.approx(1.0 + 60.0, abs=0.1)
    distance[:] = np.maximum(0.75 - ((np.arange(100) + 0.5) * 0.05 - 2.5), 0.0)
    blocked = cost_of(distance, to_goal, corner, discs_of(M2WR), np.zeros((0, 5)), state, ahead, calm, SETTINGS)
    assert blocked > 900.0


@pytest.mark.parametrize("speed, hits", [(-0.3, True), (0.0, False), (0.5, False)])
def test_a_sample_collides_with_what_moves_where_it_will_be(speed, hits):
    """The robot drives ahead; an obstacle ahead comes, stands farther than the robot gets, or moves away."""
    distance, to_goal = np.full((100, 100), 5.0, np.float32), np.full((50, 50), 30.0, np.float32)
    corner, state = np.array([-2.5, -2.5, 0.05]), np.array([0.0, 0.0, 0.0, 0.5, 0.0])
    ahead, calm = np.tile((0.5, 0.0), (40, 1)), np.zeros((2, 2), np.float32)
    movers = np.array([[1.9, 0.0, speed, 0.0, 0.25]])
    cost = cost_of(distance, to_goal, corner, discs_of(M2WR), movers, state, ahead, calm, SETTINGS)
    assert (cost > 900.0) == hits
    movers[0, :4] = 1.0, -1.6, 0.0, 0.8         # across: they meet after 2 s
    assert cost_of(distance, to_goal, corner, discs_of(M2WR), movers, state, ahead, calm, SETTINGS) > 900.0
    movers[0, 3] = -0.8
    assert cost_of(distance, to_goal, corner, discs_of(M2WR), movers, state, ahead, calm, SETTINGS) < 900.0


def test_one_in_contact_does_not_hide_another():
    """An obstacle behind overlaps the robot already: it has to come no nearer, and one ahead is still hit."""
    distance, to_goal = np.full((100, 100), 5.0, np.float32), np.full((50, 50), 30.0, np.float32)
    corner, state = np.array([-2.5, -2.5, 0.05]), np.array([0.0, 0.0, 0.0, 0.5, 0.0])
    ahead, calm = np.tile((0.5, 0.0), (40, 1)), np.zeros((2, 2), np.float32)
    behind, before = (-0.5, 0.0, 0.0, 0.0, 0.5), (1.5, 0.0, -0.3, 0.0, 0.25)
    costs = [cost_of(distance, to_goal, corner, discs_of(M2WR), np.array(movers), state, ahead, calm, SETTINGS)
             for movers in ([behind], [behind, before])]
    assert costs[0] < 100.0 and costs[1] > 900.0
