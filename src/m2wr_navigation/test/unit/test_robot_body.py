# SPDX-License-Identifier: BSD-3-Clause
"""The body of a robot comes from its description."""
import math

import numpy as np
import pytest

from m2wr_navigation.methods.body import M2WR, boxes_of
from m2wr_navigation.robot_body import body_of
from m2wr_sim.api import read_robot
from m2wr_view.outlines import Outline

BODY = """<robot name="small"><link name="base">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>{}</link>
{}</robot>"""
BOX = '<collision><geometry><box size="0.4 0.2 0.1"/></geometry></collision>'
LASER = """<link name="laser"/><joint name="j" type="fixed"><parent link="base"/><child link="laser"/>
<origin xyz="0.1 0.05 0.2" rpy="0 0 1.5707963"/></joint>
<gazebo reference="laser"><sensor type="ray" name="head"><ray><scan><horizontal><samples>10</samples>
<min_angle>-1</min_angle><max_angle>1</max_angle></horizontal></scan><range><min>0.1</min><max>5</max></range></ray>
</sensor></gazebo>"""


def test_m2wr_has_the_measures_that_its_controllers_use():
    body = body_of(read_robot("m2wr"))
    assert body.axle_x == pytest.approx(M2WR.axle_x) and body.laser == pytest.approx(M2WR.laser)
    assert body.turning_radius == pytest.approx(M2WR.turning_radius, abs=1e-3) == pytest.approx(0.45)
    assert body.inscribed_radius == pytest.approx(M2WR.inscribed_radius, abs=1e-3) == pytest.approx(0.2)
    # the wheels reach above the laser, which sees a little less than their full length
    for part in body.own_parts:
        assert part == pytest.approx(M2WR.own_parts[0], abs=0.015)


def test_a_robot_without_wheels_turns_about_its_origin():
    body = body_of(read_robot(BODY.format(BOX, LASER)))
    assert body.axle_x == 0.0 and body.laser == pytest.approx((0.1, 0.05, 0.5 * math.pi), abs=1e-6)
    assert body.turning_radius == pytest.approx(math.hypot(0.2, 0.1)) and body.inscribed_radius == pytest.approx(0.1)
    assert body.own_parts == ()         # the laser is above the box
    assert sorted(map(tuple, body.hull.tolist())) == [(-0.2, -0.1), (-0.2, 0.1), (0.2, -0.1), (0.2, 0.1)]


def test_a_body_that_is_a_mesh_has_its_hull(tmp_path):
    """A tetrahedron from the floor to 0.3 m: its widest outline is its base, its height counts."""
    path = tmp_path / "body.obj"
    path.write_text("v -0.2 -0.1 0\nv -0.2 0.1 0\nv 0.2 0 0\nv 0 0 0.3\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n")
    mesh = '<collision><geometry><mesh filename="file://{}"/></geometry></collision>'.format(path)
    body = body_of(read_robot(BODY.format(mesh, LASER)))
    assert sorted(map(tuple, body.hull.tolist())) == [(-0.2, -0.1), (-0.2, 0.1), (0.2, 0.0)]
    assert body.height == pytest.approx(0.3)


@pytest.mark.parametrize("text, reason", [(BODY.format(BOX, ""), "expected a laser"),
                                          (BODY.format("", LASER), "expected its body")])
def test_a_robot_that_cannot_be_used_is_told(text, reason):
    with pytest.raises(ValueError, match=reason):
        body_of(read_robot(text))


def test_bounds_of_parts_do_not_know_their_side():
    left = Outline(np.array([(0.0, 0.2), (0.1, 0.2), (0.1, 0.3), (0.0, 0.3)]))
    right = Outline(left.vertices * (1.0, -1.0))
    assert boxes_of([left])[0] == boxes_of([right])[0] == (0.0, 0.1, 0.2, 0.3)
    assert boxes_of([Outline(np.zeros((1, 2)), 0.1)])[0] == (-0.1, 0.1, 0.0, 0.1)
