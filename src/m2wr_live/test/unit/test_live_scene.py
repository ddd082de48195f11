# SPDX-License-Identifier: BSD-3-Clause
"""Poses of robots, beams, trails and maps of a live scene, against closed forms."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Point, TransformStamped
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker

from m2wr_live.scene.live_scene import LEAST_BEAMS, MOST_BEAMS, MOST_TRAIL, LiveScene
from m2wr_live.scene.robot_model import read_looks, read_robot_model
from m2wr_live.web.map_pixels import costmap_pixels, map_pixels, pixels_of
from m2wr_live.web.picking import first_hit, on_ground, read_ray
from m2wr_view.errors import ViewError

URDF = """<robot name="cart"><material name="leaf"><color rgba="0 1 0 1"/></material>
<link name="base"><visual><geometry><box size="1 2 3"/></geometry><material name="leaf"/></visual></link>
<link name="wheel"><visual><origin xyz="0 0 1"/><geometry><cylinder radius="0.5" length="0.1"/></geometry></visual>
</link>
<link name="laser"><visual><geometry><mesh filename="package://none/laser.stl"/></geometry></visual></link>
<joint name="w" type="continuous"><parent link="base"/><child link="wheel"/><origin xyz="0 0.2 0"/></joint>
<joint name="l" type="fixed"><parent link="base"/><child link="laser"/><origin xyz="0.5 0 0"/></joint></robot>"""
LEFT = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))      # a quarter of a turn to the left


def scene_with_robot(names=("cart::base", "cart::wheel"), places=((1, 2, 0), (1, 2, 5))):
    scene = LiveScene()
    scene.take_description("d", read_robot_model(URDF, lambda _: None))
    scene.take_links(list(names), np.array([place + LEFT for place in places], dtype=float))
    scene.update()
    return scene


def transform(parent, child, x):
    stamped = TransformStamped(child_frame_id=child)
    stamped.header.frame_id = parent
    stamped.transform.translation.x, stamped.transform.rotation.w = x, 1.0
    return stamped


def scan(frame, ranges):
    message = LaserScan(angle_min=0.0, angle_increment=math.pi / 2, range_min=0.1, range_max=10.0, ranges=ranges)
    message.header.frame_id = frame
    return message


def test_looks_are_those_of_the_description():
    model = read_robot_model(URDF, lambda _: None)
    assert model.root == "base" and set(model.links) == {"base", "wheel", "laser"}
    box, cylinder = model.shapes
    assert (box.geometry, box.scale, box.colour, box.owner) == ("box", (1, 2, 3), (0, 1, 0, 1), "base")
    assert cylinder.scale == (1.0, 1.0, 0.1) and cylinder.pose[2, 3] == 1.0
    assert model.problems == ["mesh package://none/laser.stl of link laser: no such file"]


@pytest.mark.parametrize("text", ["", "<robot/>", "<sdf/>", "no XML", URDF.replace('"0.5"', '"wide"')])
def test_a_description_that_is_no_urdf_is_refused(text):
    with pytest.raises(ViewError, match="expected"):
        read_robot_model(text, lambda _: None)


def test_links_have_true_poses_and_fixed_ones_follow():
    robot = scene_with_robot().robots["cart"]
    assert robot.poses["wheel"][:3, 3] == pytest.approx((1, 2, 5))
    assert robot.poses["laser"][:3, 3] == pytest.approx((1, 2.5, 0))         # half a metre ahead, and ahead is y


def test_a_robot_that_no_description_fits_has_its_own_looks():
    def marker(link, **fields):
        found = Marker(ns="van", type=Marker.CUBE, **fields)
        found.header.frame_id = link
        found.pose.orientation.w = found.scale.x = found.scale.y = found.scale.z = found.color.a = 1.0
        return found
    mesh = marker("van::body")
    mesh.type, mesh.mesh_resource = Marker.MESH_RESOURCE, "file:///nowhere.stl"
    model = read_looks("van", [marker("van::body"), marker("van::wheel"), marker("other::wheel"), mesh], lambda _: None)
    assert model.problems == ["mesh file:///nowhere.stl of link body: no such file"]
    scene = scene_with_robot(("van::body", "van::wheel", "cart::base"), ((1, 2, 0), (3, 2, 0), (9, 9, 0)))
    read = []
    scene.take_looks({"van": lambda: model, "cart": lambda: read.append("cart")}, ("van", "cart"))
    scene.update()
    assert not read and sorted(scene.robots) == ["cart", "van"]
    scene.take_links(["van", "cart::base"], np.array([(1, 2, 0) + LEFT, (9, 9, 0) + LEFT], dtype=float))
    scene.update()
    assert sorted(scene.robots) == ["cart"]         # where its wheel is is not known
    scene.take_links(["van::body", "van::wheel", "cart::base"], np.array([place + LEFT for place in (
        (1, 2, 0), (3, 2, 0), (9, 9, 0))], dtype=float))
    scene.update()
    assert [shape.owner for shape in scene.robots["van"].model.shapes] == ["body", "wheel"]
    assert scene.robots["van"].poses["wheel"][:3, 3] == pytest.approx((3, 2, 0))
    van = scene.robots["van"]
    scene.take_looks({"van": lambda: model}, ("van",))
    scene.update()
    assert scene.robots["van"] is van and not scene.models_with_looks
    scene.take_looks({"van": lambda: model, "shed": lambda: model, "cart": lambda: model}, ())
    scene.update()      # no other model is shown by its looks, as not all of their links have poses
    assert sorted(scene.robots) == ["cart"] and list(scene.models_with_looks) == ["van"]
    assert scene.models_with_looks["van"].poses["wheel"][:3, 3] == pytest.approx((3, 2, 0))


def test_without_true_poses_robots_are_where_tf_says():
    scene = LiveScene()
    scene.take_description("d", read_robot_model(URDF, lambda _: None))
    scene.take_transforms(TFMessage([transform("odom", "robot%d/base" % number, number) for number in (1, 2)]))
    scene.update()
    assert {name: robot.pose[0, 3] for name, robot in scene.robots.items()} == {"robot1": 1.0, "robot2": 2.0}
    assert scene.robots["robot2"].poses["wheel"][:3, 3] == pytest.approx((2, 0.2, 0))


def test_beams_start_at_the_laser_and_end_at_the_hits():
    scene = scene_with_robot()
    scene.take_scan("/scan", scan("laser", [2.0, float("inf"), float("nan")]))
    starts, ends = scene.beams["/scan"][:, 0], scene.beams["/scan"][:, 1]
    assert starts == pytest.approx(np.tile((1, 2.5, 0), (3, 1)))
    assert ends == pytest.approx(np.array(((1, 4.5, 0), (-9, 2.5, 0), (1, 2.5, 0))))
    scene.take_scan("/scan", scan("laser", [1.0] * 5000))
    assert len(scene.beams["/scan"]) == MOST_BEAMS
    scene.take_scan("/other", scan("nowhere", [1.0]))
    assert "/other" not in scene.beams
    for _ in range(2):
        for number in range(30):
            scene.take_scan("/scan%d" % number, scan("laser", [1.0] * 5000))
    assert [len(scene.beams["/scan%d" % number]) for number in range(30)] == [LEAST_BEAMS] * 30


def test_a_trail_follows_but_not_over_jumps_and_is_bounded():
    scene = scene_with_robot()
    robot = scene.robots["cart"]
    for x in np.linspace(1.0, 2.0, 101):
        scene.take_links(["cart::base", "cart::wheel"], np.array([(x, 2, 0) + LEFT, (x, 2, 0) + LEFT]))
        scene.update()
    assert 20 < len(robot.trail) < 40 and all(driven for _, _, _, driven in robot.trail[1:])
    scene.take_links(["cart::base", "cart::wheel"], np.array([(9, 9, 0) + LEFT, (9, 9, 0) + LEFT]))
    scene.update()
    assert robot.trail[-1] == (9.0, 9.0, 0.0, False)
    robot.trail = [(0.0, 0.0, 0.0, True)] * MOST_TRAIL
    scene.update()
    assert len(robot.trail) + robot.first == MOST_TRAIL + 1 and len(robot.trail) < MOST_TRAIL


def test_a_clock_that_goes_back_begins_a_new_run():
    scene = scene_with_robot()
    scene.take_time(50.0)
    scene.take_mark(False, Point(1, 2, 0))
    scene.take_mark(False, Point(float("nan"), 2, 0))
    assert scene.hits == [(1, 2)]
    scene.take_time(49.9)
    assert scene.hits
    scene.take_time(0.0)
    assert not scene.hits and scene.run == 1 and not scene.robots["cart"].trail


def test_maps_are_checked_and_drawn_with_y_upwards():
    scene, message = LiveScene(), OccupancyGrid(data=[0, 100, -1, 0, 0, 0])
    message.info.width, message.info.height, message.info.resolution = 3, 2, 0.5
    message.info.origin.orientation.w = 1.0
    scene.take_map("/map", message)
    pixels = map_pixels(scene.grids["/map"].cells)
    assert pixels.shape == (2, 3, 4)
    assert pixels[1, 1, 0] < 60 < pixels[1, 0, 0] and pixels[1, 2, 3] == 0     # the map's first row is the lowest
    message.data = [0]
    with pytest.raises(ViewError, match="expected one per cell"):
        scene.take_map("/map", message)
    wall = np.zeros((4000, 4000), dtype=np.int8)
    wall[:, 1234] = 100
    assert np.all((map_pixels(wall)[..., 0] < 60).any(axis=1))


def test_a_costmap_shows_costs_and_takes_changes():
    scene, message = LiveScene(), OccupancyGrid(data=[0, 1, 98, 99, 100, -1])
    message.info.width, message.info.height, message.info.resolution = 3, 2, 0.5
    message.info.origin.orientation.w = 1.0
    topic = "/move_base/global_costmap/costmap"
    scene.take_map(topic, message)
    pixels = pixels_of(topic, scene.grids[topic].cells)
    assert np.array_equal(pixels, costmap_pixels(scene.grids[topic].cells))
    low, high = pixels[1], pixels[0]
    assert low[0, 3] == 0 and high[2, 3] == 0 and low[1, 2] > 200 > 100 > low[1, 0] and low[2, 0] > 200
    assert len({tuple(colour) for colour in (low[1], low[2], high[0], high[1])}) == 4
    change = OccupancyGridUpdate(x=1, y=1, width=2, height=1, data=[7, 8])
    before = scene.grids[topic].cells
    scene.take_map_update(topic + "_updates", change)
    assert scene.grids[topic].cells.tolist() == [[0, 1, 98], [99, 7, 8]] and before[1, 1] == 100
    scene.take_map_update("/other_updates", change)
    for wrong in (OccupancyGridUpdate(x=2, y=0, width=2, height=1, data=[7, 8]),
                  OccupancyGridUpdate(x=-1, y=0, width=2, height=1, data=[7, 8]),
                  OccupancyGridUpdate(x=0, y=0, width=2, height=1, data=[7])):
        with pytest.raises(ViewError, match="expected one per cell, in the map of 3 x 2"):
            scene.take_map_update(topic + "_updates", wrong)


def test_a_click_means_the_ground_or_the_first_body():
    assert on_ground((0, 0, 2), (1, 0, -1)) == pytest.approx((2, 0, 0))
    assert on_ground((0, 0, 2), (math.nan, 0, -1)) is None and on_ground((0, math.inf, 2), (1, 0, -1)) is None
    assert on_ground((0, 0, 2), (1, 0, 0.1)) is None and on_ground((0, 0, 2), (1, 0, -1e-6)) is None
    model = read_robot_model(URDF, lambda _: None)
    near, far = np.eye(4), np.eye(4)
    near[0, 3], far[0, 3] = 5.0, 9.0
    shapes = [model.shapes[0]._replace(owner="far"), model.shapes[0]._replace(owner="near")]
    from m2wr_live.scene.shapes import UNITS
    assert first_hit((0, 0, 0), (1, 0, 0), shapes, [far, near], UNITS) == "near"
    assert first_hit((0, 0, 0), (-1, 0, 0), shapes, [far, near], UNITS) is None
    assert first_hit((0, 0.9, 1.4), (1, 0, 0), shapes, [far, near], UNITS) == "near"
    assert first_hit((0, 1.1, 0), (1, 0, 0), shapes, [far, near], UNITS) is None


@pytest.mark.parametrize("origin", [(math.nan, 0, 2), (0, math.inf, 2), None, "abc", (1, 2), ((0, 0, 2), (1, 1, 1))])
def test_a_ray_that_is_no_ray_is_refused_with_why(origin):
    with pytest.raises(ViewError, match="expected three finite numbers"):
        read_ray(origin, (0, 0, -1))
    assert read_ray((0, 1, 2), [0, 0, -1]).tolist() == [[0, 1, 2], [0, 0, -1]]
