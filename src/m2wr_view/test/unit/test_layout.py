# SPDX-License-Identifier: BSD-3-Clause
"""What of a world is shown: all of it, or of a large one what is near."""
import numpy as np
import pytest
from visualization_msgs.msg import Marker

from m2wr_view.layout import SURROUNDINGS, needed_bounds, with_obstacles
from m2wr_view.outlines import Outline


def disc(x, y, radius=0.5):
    return Outline(np.array([(x, y)]), radius)


def corners(outlines, low=(0.0, -4.0), high=(0.0, -4.0)):
    return np.concatenate(with_obstacles(np.array(low), np.array(high), outlines)).tolist()


def test_a_world_is_shown_whole():
    # the robot 13 m from the wall on the other side, as in the lower half of world02
    assert corners([disc(0.0, 9.5), disc(0.0, -9.5), disc(9.5, 0.0)]) == [-0.5, -10.0, 10.0, 10.0]


def test_of_a_large_world_what_is_near_is_shown():
    assert corners([disc(0.0, 0.0), disc(0.0, 40.0)]) == [-0.5, -4.0, 0.5, 0.5]
    wall = Outline(np.array([(-50.0, 0.0), (50.0, 0.0), (50.0, 1.0), (-50.0, 1.0)]))
    assert corners([wall]) == [-SURROUNDINGS, -4.0, SURROUNDINGS, 1.0]      # cut where the surroundings end


def test_an_area_without_obstacles_stays_as_it_is():
    assert corners([], (-40.0, 0.0), (40.0, 1.0)) == [-40.0, 0.0, 40.0, 1.0]


@pytest.mark.parametrize("place", [(0.0, -8.0), (0.0, 8.0), (-8.0, 0.0)])
def test_every_wall_is_in_view_wherever_the_robot_is(make, scene, place):
    walls = [(0.0, 9.5), (0.0, -9.5), (9.5, 0.0), (-9.5, 0.0)]
    scene.take_markers(make.world(*[make.marker(Marker.CUBE, (1.0, 1.0, 1.0), x, y, name="wall%d" % number)
                                    for number, (x, y) in enumerate(walls)]))
    scene.take_odometry(make.odometry(0.0, *place))
    low_x, low_y, high_x, high_y = needed_bounds(scene)
    assert low_x <= -10.0 and low_y <= -10.0 and high_x >= 10.0 and high_y >= 10.0
