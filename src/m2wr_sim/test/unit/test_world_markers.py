# SPDX-License-Identifier: BSD-3-Clause
"""Markers of a world: every shape once, at its place, in its colour; sent again only when something has changed."""
from dataclasses import replace

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from conftest import at
from m2wr_sim.model.types import Box, Collision, Cylinder, Heightmap, Mesh, MeshFile, Sphere, Visual
from m2wr_sim.ros.world_markers import (
    MOST_TRIANGLES,
    OTHER_COLOUR,
    GroundMarkers,
    WorldMarkers,
    colour_of,
    is_robot,
    marker_of,
)
from m2wr_sim.runtime.ports import LocalPort


class Shown:
    """A simulator with its markers."""

    def __init__(self, rig, rate=10.0):
        self.simulator, self.port = rig.simulator, LocalPort("/gazebo/world_markers")
        self.port.publish = lambda message: self.port.messages.append(
            [(marker.ns, marker.id, marker.pose.position.x, marker.action) for marker in message.markers])
        self.markers = WorldMarkers(self.simulator, self.port, "odom", rate)
        self.simulator.add_observer(self.markers, "markers")

    def arrays(self):
        """Return {model: x} of each array sent."""
        return [{name: round(x, 3) for name, _, x, action in array if action == Marker.ADD}
                for array in self.port.messages]


@pytest.fixture
def shown(make_rig, build, m2wr):
    rig = make_rig()
    rig.simulator.spawn(build.box("crate", 3.0, 0.0, 0.25, size=(0.5, 0.5, 0.5)), at(3.0, 0.0, 0.25))
    rig.simulator.spawn(m2wr, at(z=0.1), namespace="/")
    rig.shown = Shown(rig)
    return rig


def test_all_is_told_at_the_start_but_robots_and_ground(shown):
    assert shown.shown.arrays() == [{"crate": 3.0}]
    assert shown.shown.port.messages[0][0][3] == Marker.DELETEALL


def test_nothing_is_told_while_nothing_moves(shown):
    shown.run(2.0)
    assert len(shown.shown.port.messages) == 1


def test_a_move_a_spawn_and_a_deletion_are_told(shown, build):
    simulator = shown.simulator
    simulator.set_model_state("crate", at(5.0, 1.0, 0.25), (0, 0, 0), (0, 0, 0))
    shown.run(0.2)
    simulator.spawn(build.box("second", -2.0, 0.0, 0.25, size=(0.5, 0.5, 0.5)), at(-2.0, 0.0, 0.25))
    shown.run(0.2)
    simulator.delete("crate")
    shown.run(0.2)
    assert shown.shown.arrays()[1:] == [{"crate": 5.0}, {"crate": 5.0, "second": -2.0}, {"second": -2.0}]


def test_what_rolls_is_followed_at_the_rate(make_rig, build):
    rig = make_rig()
    ball = build.one_link("ball", Sphere(0.1), at(z=0.1), static=False)
    rig.simulator.spawn(ball, at(z=0.1))
    rig.shown = Shown(rig, rate=5.0)
    rig.simulator.set_model_state("ball", at(z=0.1), (1.0, 0, 0), (0, 0, 0))
    rig.run(1.0)
    arrays = rig.shown.arrays()
    assert 5 <= len(arrays) <= 7 and arrays[-1]["ball"] > arrays[1]["ball"] > 0.0


def test_what_was_published_does_not_change_afterwards(shown, build):
    simulator, kept = shown.simulator, []
    shown.shown.port.publish = kept.append              # as a latched topic keeps it
    for x in (5.0, 6.0):
        simulator.set_model_state("crate", at(x, 1.0, 0.25), (0, 0, 0), (0, 0, 0))
        shown.run(0.2)
    before, after = [array.markers[1] for array in kept]
    assert (before.pose.position.x, after.pose.position.x) == (5.0, 6.0)
    after.pose = before.pose
    assert before == after                              # nothing else has changed


def test_changes_while_paused_are_told(shown):
    shown.simulator.paused = True
    shown.simulator.set_model_state("crate", at(6.0, 1.0, 0.25), (0, 0, 0), (0, 0, 0))
    shown.shown.markers.turn()
    assert shown.shown.arrays()[-1] == {"crate": 6.0}


@pytest.mark.parametrize("shape, kind, scale", [
    (Box((1.0, 2.0, 3.0)), Marker.CUBE, (1.0, 2.0, 3.0)), (Sphere(0.5), Marker.SPHERE, (1.0, 1.0, 1.0)),
    (Cylinder(0.5, 2.0), Marker.CYLINDER, (1.0, 1.0, 2.0))])
def test_a_shape_becomes_its_marker(shape, kind, scale):
    marker = marker_of(Collision("c", shape), at(1.0, 2.0, 3.0), (0.1, 0.2, 0.3, 1.0))
    assert marker.type == kind and (marker.scale.x, marker.scale.y, marker.scale.z) == scale
    assert (marker.pose.position.x, marker.pose.position.y, marker.pose.position.z) == (1.0, 2.0, 3.0)
    assert (marker.color.r, marker.color.g, marker.color.b, marker.color.a) == (0.1, 0.2, 0.3, 1.0)


def test_a_mesh_is_shown_up_to_a_size():
    corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)])
    small = Mesh(corners, np.array([(0, 1, 2)], np.int32))
    marker = marker_of(Collision("c", small), at(), OTHER_COLOUR)
    assert marker.type == Marker.TRIANGLE_LIST and [(p.x, p.y) for p in marker.points] == [(0, 0), (1, 0), (0, 1)]
    large = Mesh(corners, np.zeros((MOST_TRIANGLES + 1, 3), np.int32))
    assert marker_of(Collision("c", large), at(), OTHER_COLOUR) is None


def test_the_colour_is_that_of_the_visual(build):
    link = build.box("crate", 0.0, 0.0, 0.0, size=(1.0, 1.0, 1.0)).links[0]
    collision = link.collisions[0]
    other, same = Visual("v", Sphere(1.0), rgba=(1, 0, 0, 1)), Visual("w", collision.geometry, material="Gazebo/Green")
    assert colour_of(link, collision) == OTHER_COLOUR
    assert colour_of(replace(link, visuals=(other, same)), collision) == (0.0, 1.0, 0.0, 1.0)
    assert colour_of(replace(link, visuals=(other,)), collision) == (1, 0, 0, 1)


def test_a_model_with_plugins_is_a_robot(m2wr, build):
    assert is_robot(m2wr) and not is_robot(build.ground())


def test_ground_is_told_once_and_again_when_it_changes(make_rig, build):
    rig, port, arrays = make_rig(), LocalPort("/gazebo/ground_markers"), []
    port.publish = arrays.append
    ground = GroundMarkers(rig.simulator, port, "odom")
    rig.simulator.add_observer(ground, "ground")
    rig.run(0.1)
    assert not arrays
    heights = np.zeros((5, 5))
    heights[2, 2] = 0.4
    rig.simulator.spawn(build.one_link("hill", Heightmap(heights, (4.0, 4.0)), at(), static=True), at(3.0, 0.0, 0.0))
    rig.run(0.1)
    rig.simulator.spawn(build.box("crate", -3.0, 0.0, 0.25, size=(0.5, 0.5, 0.5)), at(-3.0, 0.0, 0.25))
    rig.run(0.1)
    rig.simulator.delete("hill")
    rig.run(0.1)
    assert [len(array.markers) for array in arrays] == [2, 1]
    marker = arrays[0].markers[1]
    assert (marker.ns, marker.header.frame_id, len(marker.points), len(marker.colors)) == ("hill", "odom", 96, 96)
    assert max((point.z, point.x, point.y) for point in marker.points) == pytest.approx((0.4, 3.0, 0.0))


def test_ground_has_no_world_marker(make_rig, build):
    rig = make_rig()
    rig.simulator.spawn(build.one_link("hill", Heightmap(np.zeros((5, 5)), (4.0, 4.0)), at(), static=True), at())
    assert Shown(rig).arrays() == [{}]


def test_a_mesh_has_the_colour_of_the_visual_of_its_file(build):
    mesh = Mesh(np.eye(3), np.array([[0, 1, 2]], dtype=np.int32), "/ice.stl")
    link = replace(build.one_link("m", mesh, at()).links[0], visuals=(
        Visual("a", MeshFile("/mud.stl"), rgba=(0.3, 0.2, 0.1, 1.0)),
        Visual("b", MeshFile("/ice.stl"), rgba=(0.8, 0.9, 1.0, 1.0))))
    assert colour_of(link, link.collisions[0]) == (0.8, 0.9, 1.0, 1.0)
