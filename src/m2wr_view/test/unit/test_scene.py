# SPDX-License-Identifier: BSD-3-Clause
"""Messages become a scene: places, frames, late scans, resets."""
import math

import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from conftest import URDF
from m2wr_view.errors import ViewError
from m2wr_view.frames import inverse, matrix_from_rpy


def test_a_scan_is_placed_where_the_robot_was_when_it_was_taken(make, scene):
    scene.take_description(make.text(URDF))         # the laser looks to the left, half a metre ahead
    scene.take_odometry(make.odometry(1.0, 0.0, 0.0))
    scene.take_odometry(make.odometry(2.0, 2.0, 0.0))
    scene.take_scan(make.scan(1.5, [3.0, 3.0, math.inf], -0.1, 0.1))
    origin, ends, hits = scene.rays()
    assert origin == pytest.approx([1.5, 0.0])
    assert ends[1] == pytest.approx([1.5, 3.0]) and hits.tolist() == [True, True, False]
    assert np.hypot(*(ends[2] - origin)) == pytest.approx(10.0)


def test_tf_tells_of_the_laser_before_the_description(make, scene):
    scene.take_description(make.text(URDF))
    scene.take_odometry(make.odometry(1.0, 0.0, 0.0))
    scene.take_transforms(make.transform(1.0, "base", "laser", -1.0, 0.0))
    scene.take_scan(make.scan(1.0, [1.0, 1.0, 1.0]))
    assert scene.rays()[0] == pytest.approx([-1.0, 0.0])


def test_without_odometry_tf_moves_the_robot(make, scene):
    scene.take_transforms(make.transform(1.0, "odom", "base", 2.0, 3.0, 0.5))
    assert scene.pose == pytest.approx([2.0, 3.0, 0.5])


def test_readings_that_are_none_end_at_the_laser(make, scene):
    scene.take_odometry(make.odometry(1.0, 0.0, 0.0))
    scene.take_scan(make.scan(1.0, [math.nan, -math.inf, 0.01]))
    origin, ends, hits = scene.rays()
    assert not hits.any() and np.allclose(ends, origin)


def test_a_map_lies_where_its_frame_is(make, scene):
    scene.take_odometry(make.odometry(1.0, 0.0, 0.0))
    scene.take_map(make.grid([[0, 100]], 0.5, 1.0, 2.0, "map"))
    scene.take_transforms(make.transform(1.0, "map", "odom", 1.0, 0.0))
    assert scene.grid[0].dot((0.0, 0.0, 0.0, 1.0))[:2] == pytest.approx([0.0, 2.0])


def test_a_map_with_too_few_cells_is_refused(make, scene):
    message = make.grid([[0, 100]], 0.5, 1.0, 2.0)
    message.info.width = 3
    with pytest.raises(ViewError, match="3 x 1 cells has 2 values"):
        scene.take_map(message)


def test_a_jump_is_not_driven_and_a_reset_clears_the_trail(make, scene):
    for now, x in ((1.0, 0.0), (1.1, 0.1), (1.2, 5.0), (1.3, 5.1)):
        scene.take_odometry(make.odometry(now, x, 0.0))
    assert [driven for _, _, _, driven in scene.trail] == [False, True, False, True]
    scene.take_hit_point(make.point(1.0, 1.0))
    version = scene.trail_version
    scene.take_clock(make.clock(0.1))
    assert not scene.trail and not scene.hits and scene.trail_version > version


def test_a_transform_and_its_inverse_cancel():
    matrix = matrix_from_rpy((1.0, -2.0, 3.0), (0.3, -0.7, 2.9))
    assert np.allclose(inverse(matrix).dot(matrix), np.eye(4), atol=1e-12)


def test_several_robots_are_a_team_and_a_single_one_is_none(make, scene):
    scene.take_robots(make.robots(m2wr=(1.0, 2.0, 0.0)))
    assert not scene.team.members and scene.places() == []
    for x in (0.0, 0.05, 0.2, 3.0):
        scene.take_robots(make.robots(robot1=(x, 0.0, 0.0), robot2=(5.0, 5.0, 1.0)))
    assert scene.team.members["robot1"].path == [(0.0, 0.0, False), (0.2, 0.0, True), (3.0, 0.0, False)]
    assert scene.team.members["robot2"].path == [(5.0, 5.0, False)]
    assert scene.places() == [(3.0, 0.0), (5.0, 5.0)]
    scene.take_robots(make.robots(robot1=(math.nan, 0.0, 0.0), robot2=(5.0, 5.0, 1.0), robot3=(0.0, 0.0, 0.0)))
    assert list(scene.team.members) == ["robot2", "robot3"]


def test_a_reset_clears_the_paths_of_a_team(make, scene):
    scene.take_clock(make.clock(5.0))
    scene.take_robots(make.robots(robot1=(0.0, 0.0, 0.0), robot2=(5.0, 5.0, 1.0)))
    scene.take_clock(make.clock(0.0))
    assert [member.path for member in scene.team.members.values()] == [[], []]


def test_a_robot_with_odometry_is_drawn_by_it(make, scene):
    scene.take_odometry(make.odometry(1.0, 0.0, 0.0))
    scene.take_robots(make.robots(robot1=(0.0, 0.0, 0.0), robot2=(5.0, 5.0, 1.0)))
    assert not scene.team.members and scene.places() == [(0.0, 0.0)]


def test_names_of_places_are_the_texts_among_markers(make, scene):
    texts = [Marker(type=Marker.TEXT_VIEW_FACING, text=text) for text in ("A", "B" * 1000)]
    texts[0].pose.position.x, texts[1].pose.position.y = math.inf, 2.0
    scene.take_places(MarkerArray([make.marker(Marker.CYLINDER, (1.0, 1.0, 0.1), 3.0, 3.0), *texts]))
    assert scene.names == [(0.0, 2.0, "B" * 30)]
