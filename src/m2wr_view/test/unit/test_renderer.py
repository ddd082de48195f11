# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of scenes: the right colour in the right place, to scale, fast; texts that can be read."""
import math
import time

import numpy as np
import pytest
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from conftest import URDF
from m2wr_view.layout import nice_step
from m2wr_view.renderer import ROBOT_COLOUR, Renderer
from m2wr_view.run_picture import GOAL_COLOUR, HIT_COLOUR, OBSTACLE_COLOUR, OVERHANG_COLOUR, STATE_COLOURS
from m2wr_view.shapes import TEAM_COLOURS, rgb

BOUNDS = (-2.0, -2.0, 8.0, 7.0)


@pytest.fixture
def full(make, scene):
    """A scene with one of each kind."""
    scene.take_description(make.text(URDF))
    scene.take_markers(make.world(make.marker(Marker.CUBE, (1.0, 2.0, 1.0), 6.0, 4.0, name="crate"),
                                  make.marker(Marker.CUBE, (1.0, 1.0, 0.1), 0.0, 5.0, 2.0, name="shelf")))
    scene.take_line(make.line((0.0, 0.0), (3.0, 5.0)))
    scene.take_map(make.grid([[100, 0], [-1, 100]], 1.0, -2.0, -2.0))
    scene.take_state(make.text("go_to_point"))
    for number in range(41):
        scene.take_odometry(make.odometry(0.1 * number, 0.1 * number, 0.0))
        if number == 20:
            scene.take_state(make.text("wall_following"))
    scene.take_hit_point(make.point(2.0, 0.0))
    scene.take_scan(make.scan(4.0, [2.0] * 101, -0.5, 0.5))
    return scene


class Picture:
    def __init__(self, scene, width=800, height=800, bounds=BOUNDS):
        self.renderer = Renderer(width, height, bounds)
        self.pixels = np.asarray(self.renderer.draw(scene)) / 255.0
        self.view = self.renderer._view

    def at(self, x, y):
        column, row = self.view.pixel(x, y)
        return tuple(self.pixels[int(row), int(column)])

    def count(self, colour):
        return int(np.count_nonzero(np.abs(self.pixels - rgb(colour)).max(axis=2) < 0.03))


def test_every_thing_has_its_colour_in_its_place(full):
    picture, near = Picture(full), dict(abs=0.03)
    assert picture.at(6.0, 4.0) == pytest.approx(rgb(OBSTACLE_COLOUR), **near)
    assert picture.at(6.45, 3.05) == pytest.approx(rgb(OBSTACLE_COLOUR), **near)
    assert picture.at(6.55, 3.05) != pytest.approx(rgb(OBSTACLE_COLOUR), abs=0.1)        # just beside it
    assert picture.at(0.3, 5.3) == pytest.approx(rgb(OVERHANG_COLOUR), **near)
    assert picture.at(3.0, 5.0) == pytest.approx(rgb(GOAL_COLOUR), **near)
    assert picture.at(2.0, 0.0) == pytest.approx(rgb(HIT_COLOUR), **near)
    assert picture.at(1.0, 0.0) == pytest.approx(rgb(STATE_COLOURS["go_to_point"]), **near)
    assert picture.at(3.0, 0.0) == pytest.approx(rgb(STATE_COLOURS["wall_following"]), **near)
    assert picture.at(4.4, 0.1) == pytest.approx(rgb(ROBOT_COLOUR), **near)              # faces along x
    assert max(picture.at(-1.6, -1.6)) < 0.2 and max(picture.at(-0.6, -0.6)) < 0.2       # occupied
    assert min(picture.at(-1.6, -0.6)) > 0.95                                            # unknown
    inside = picture.at(4.5, 1.2)                                                        # rays on their tint
    assert inside[2] > 0.9 and 0.3 < inside[0] < inside[1] < inside[2]
    assert picture.at(7.5, 1.2) == (1.0, 1.0, 1.0)                                       # no rays there
    assert picture.at(4.5, 2.0)[2] > picture.at(4.5, 2.0)[0] + 0.4                       # where the beams end


def test_a_robot_that_turns_is_drawn_turned(make, full):
    full.take_odometry(make.odometry(5.0, 4.0, 0.0, math.pi / 2))
    picture = Picture(full)
    assert picture.at(4.1, 0.45) == pytest.approx(rgb(ROBOT_COLOUR), abs=0.03)
    assert picture.at(4.45, 0.1) != pytest.approx(rgb(ROBOT_COLOUR), abs=0.1)


def test_a_metre_is_as_long_across_as_up(full):
    picture = Picture(full)
    grey = np.abs(picture.pixels - rgb(OBSTACLE_COLOUR)).max(axis=2) < 0.03
    top, bottom = int(picture.view.pixel(0, 6.0)[1]), int(picture.view.pixel(0, 2.0)[1])
    crate = grey[top:bottom, :]
    rows, columns = np.flatnonzero(crate.sum(axis=1) > 20), np.flatnonzero(crate.sum(axis=0) > 60)
    assert (rows[-1] - rows[0]) / picture.view.scale == pytest.approx(2.0, abs=0.06)
    assert (columns[-1] - columns[0]) / picture.view.scale == pytest.approx(1.0, abs=0.06)


def test_trail_grows_incrementally_and_is_cleared_after_a_reset(make, full):
    picture = Picture(full)
    before = picture.count(STATE_COLOURS["wall_following"])
    for number in range(41, 61):
        full.take_odometry(make.odometry(0.1 * number, 4.0, 0.1 * number - 4.0))
    grown = Picture(full)                                                   # all at once
    picture.pixels = np.asarray(picture.renderer.draw(full)) / 255.0        # bit by bit
    assert picture.count(STATE_COLOURS["wall_following"]) > before + 200
    assert np.abs(grown.pixels - picture.pixels).max(axis=2)[60:600].mean() < 0.001
    full.forget_run()
    picture.pixels = np.asarray(picture.renderer.draw(full)) / 255.0
    assert picture.at(1.0, 0.0) != pytest.approx(rgb(STATE_COLOURS["go_to_point"]), abs=0.1)


def test_what_moves_away_is_no_longer_there(make, full):
    picture = Picture(full)
    full.take_markers(make.world(make.marker(Marker.CUBE, (1.0, 2.0, 1.0), 2.0, 4.0, name="crate")))
    picture.pixels = np.asarray(picture.renderer.draw(full)) / 255.0
    assert picture.at(5.7, 4.3) == (1.0, 1.0, 1.0)
    assert picture.at(2.0, 4.5) == pytest.approx(rgb(OBSTACLE_COLOUR), abs=0.03)


def test_without_bounds_everything_is_in_view(full):
    picture = Picture(full, bounds=None)
    for x, y in ((6.45, 4.9), (0.4, 5.4), (-1.9, -1.9), (4.4, 0.1)):
        left, top, width, height = picture.view.window
        column, row = picture.view.pixel(x, y)
        assert left < column < left + width and top < row < top + height
    assert picture.at(6.0, 4.0) == pytest.approx(rgb(OBSTACLE_COLOUR), abs=0.03)


def test_shapes_that_overlap_are_one_area(make, scene):
    scene.take_markers(make.world(make.marker(Marker.CUBE, (2.0, 1.0, 1.0), 2.0, 4.0, name="one"),
                                  make.marker(Marker.CUBE, (2.0, 1.0, 1.0), 3.0, 4.0, name="two"),
                                  make.marker(Marker.CYLINDER, (1.0, 1.0, 1.0), 3.8, 4.0, name="three")))
    picture = Picture(scene)
    for x in np.arange(1.1, 4.2, 0.01):         # not a line in it, nor a hole
        assert picture.at(x, 4.05) == pytest.approx(rgb(OBSTACLE_COLOUR), abs=0.03), x
    (column, row), colours = picture.view.pixel(1.0, 4.0), picture.pixels.min(axis=2)
    assert colours[int(row), int(column) - 3:int(column) + 3].min() < rgb(OBSTACLE_COLOUR)[0] - 0.1  # but one around it


class Texts(Renderer):
    """Notes where each text is: left, upper, right and lower edge [pixels]."""

    def _text(self, context, text, x, y, anchor=0.0):
        left, upper, width, height, advance, _ = context.text_extents(text)
        corners = [context.user_to_device(x - anchor * advance + left + across, y + upper + down)
                   for across in (0.0, width) for down in (0.0, height)]
        self.boxes[text] = tuple(np.min(corners, axis=0)) + tuple(np.max(corners, axis=0))
        return super()._text(context, text, x, y, anchor)


@pytest.mark.parametrize("size", [(800, 800), (500, 500), (400, 400), (1280, 720)])
def test_texts_do_not_overlap_and_are_inside_the_picture(make, full, size):
    full.take_leave_point(make.point(3.0, 0.0))
    full.take_state(make.text("goal_unreachable"))
    full.take_odometry(make.odometry(1234.5, -1.25, -1.25, -3.0))
    renderer = Texts(*size)
    renderer.boxes = {}
    renderer.draw(full)
    boxes = sorted(renderer.boxes.items())
    assert {"goal unreachable", "t = 1234.5 s", "leave point", "x [m]", "y [m]"} <= set(renderer.boxes)
    for number, (text, (left, upper, right, lower)) in enumerate(boxes):
        assert left >= 0.0 and upper >= 0.0 and right <= size[0] and lower <= size[1], text
        for other, (x0, y0, x1, y1) in boxes[:number]:
            assert right <= x0 or x1 <= left or lower <= y0 or y1 <= upper, (text, other)


def test_texts_of_a_small_picture_can_be_read(full):
    renderer = Texts(300, 300)
    renderer.boxes = {}
    renderer.draw(full)
    left, upper, right, lower = renderer.boxes["x [m]"]
    assert lower - upper >= 7.0         # pixels; a bracket is as high as letters get


def legend(scene, bounds=BOUNDS):
    """The words of the legend."""
    renderer = Texts(800, 800, bounds)
    renderer.boxes = {}
    renderer.draw(scene)
    return list(renderer.boxes)


def test_a_path_below_the_robot_is_not_in_the_legend(make, scene):
    for number in range(10):
        scene.take_odometry(make.odometry(0.1 * number, 0.0, 0.0, 0.3 * number))
        scene.take_odometry(make.odometry(0.1 * number, 0.05, 0.0, 0.3 * number))
    assert "path" not in legend(scene)
    scene.take_odometry(make.odometry(2.0, 0.4, 0.0))
    assert "path" in legend(scene)


def test_what_is_outside_the_picture_is_not_in_the_legend(full):
    assert {"obstacle", "above the robot"} <= set(legend(full))
    assert not {"obstacle", "above the robot"} & set(legend(full, (-2.0, -2.0, 2.0, 2.0)))


def test_each_robot_of_a_team_has_its_colour_and_path(make, scene):
    for step in range(31):
        scene.take_robots(make.robots(robot2=(0.1 * step, 5.0, 0.0), robot1=(0.1 * step, 1.0, 0.0)))
    picture = Picture(scene)
    for y, colour in ((1.0, TEAM_COLOURS[0]), (5.0, TEAM_COLOURS[1])):
        assert picture.at(2.82, y + 0.1) == pytest.approx(rgb(colour), abs=0.03)
        assert picture.at(1.0, y) == pytest.approx(rgb(colour), abs=0.03)
    assert {"robot1", "robot2"} <= set(legend(scene))


def test_without_bounds_a_team_and_named_places_are_in_view(make, scene):
    place = Marker(type=Marker.TEXT_VIEW_FACING, text="far")
    place.pose.position.x = -20.0
    scene.take_places(MarkerArray([place]))
    scene.take_robots(make.robots(robot1=(0.0, 0.0, 0.0), robot2=(9.0, 9.0, 0.0)))
    picture = Picture(scene, bounds=None)
    scene.take_robots(make.robots(robot1=(0.0, 0.0, 0.0), robot2=(15.0, 9.0, 0.0)))
    picture.renderer.draw(scene)
    low_x, _, high_x, high_y = picture.renderer._view.bounds
    assert low_x < -20.0 and high_x > 15.0 and high_y > 9.0


def test_an_empty_scene_can_be_drawn(scene):
    picture = Picture(scene, bounds=None)
    assert picture.pixels.shape == (800, 800, 3) and picture.pixels.min() < 0.3      # axes and scale bar


@pytest.mark.parametrize("size", [(200, 200), (1200, 800)])
def test_other_sizes_are_filled(full, size):
    picture = Picture(full, *size)
    assert picture.pixels.shape == (size[1], size[0], 3)
    assert picture.at(6.0, 4.0) == pytest.approx(rgb(OBSTACLE_COLOUR), abs=0.03)


@pytest.mark.parametrize("span, parts, step", [(10.0, 10, 1.0), (11.0, 10, 2.0), (0.3, 10, 0.05), (90.0, 10, 10.0)])
def test_steps_of_the_axes_are_round(span, parts, step):
    assert nice_step(span, parts) == pytest.approx(step)


def test_a_frame_takes_little_time(make, full):
    renderer, spent = Renderer(800, 800), []
    for number in range(40):
        full.take_odometry(make.odometry(5.0 + 0.1 * number, 4.0, 0.02 * number))
        full.take_scan(make.scan(5.0 + 0.1 * number, [2.0] * 720, -1.57, 1.57))
        began = time.process_time()
        renderer.draw(full)
        spent.append(time.process_time() - began)
    assert sorted(spent)[10] < 0.015        # of processor time; a loaded machine spoils some of them


def test_ground_is_below_all_else_in_its_colours(full):
    marker = Marker(type=Marker.TRIANGLE_LIST)
    marker.scale.x = marker.scale.y = marker.scale.z = marker.pose.orientation.w = 1.0
    for x, z in ((-9.0, 0.0), (0.0, 0.5)):          # two pieces, dark and bright
        for dx, dy in ((0.0, -9.0), (9.0, -9.0), (9.0, 9.0), (0.0, -9.0), (9.0, 9.0), (0.0, 9.0)):
            marker.points.append(Point(x + dx, dy, z))
            marker.colors.append(ColorRGBA(0.2 + z, 0.2, 0.2, 1.0))
    before = Picture(full)
    full.take_ground(MarkerArray([marker]))
    after = Picture(full)
    assert after.count("#333333") > 1000 and after.count("#B23333") > 1000 and not before.count("#B23333")
    for colour in (ROBOT_COLOUR, OBSTACLE_COLOUR):
        assert after.count(colour) == pytest.approx(before.count(colour), rel=0.01)      # but for what edges blend with
