# SPDX-License-Identifier: BSD-3-Clause
"""Looks of robots and of models with meshes: each visual once, in the frame of its link."""
from dataclasses import replace

import pytest
from visualization_msgs.msg import Marker

from conftest import at
from m2wr_sim.model.types import Box, MeshFile, Plane, Sphere, Visual
from m2wr_sim.ros.visual_markers import VisualMarkers, has_looks, visual_marker, visual_markers
from m2wr_sim.runtime.ports import LocalPort


@pytest.fixture
def shown(make_rig, build, m2wr):
    rig = make_rig()
    rig.simulator.spawn(build.box("crate", 3.0, 0.0, 0.25, size=(0.5, 0.5, 0.5)), at(3.0, 0.0, 0.25))
    rig.simulator.spawn(m2wr, at(z=0.1), namespace="/")
    rig.port = LocalPort("/gazebo/visual_markers")
    rig.port.publish = lambda message: rig.port.messages.append(message.markers)
    rig.simulator.add_observer(VisualMarkers(rig.simulator, rig.port), "looks")
    return rig


def test_each_visual_of_a_robot_is_told_in_its_link(shown, m2wr):
    (first, *markers), = shown.port.messages
    assert first.action == Marker.DELETEALL
    assert [marker.header.frame_id for marker in markers] == [
        "m2wr::" + link.name for link in m2wr.links for _ in link.visuals]
    assert {(marker.ns, marker.text) for marker in markers} == {("m2wr", "robot")}
    assert len({marker.id for marker in markers}) == len(markers)


def test_looks_are_told_again_when_a_robot_comes_or_leaves(shown, build, m2wr):
    simulator = shown.simulator
    simulator.spawn(build.box("second", -2.0, 0.0, 0.25, size=(0.5, 0.5, 0.5)), at(-2.0, 0.0, 0.25))
    shown.run(0.2)
    assert len(shown.port.messages) == 1
    simulator.delete("m2wr")
    shown.run(0.2)
    assert len(shown.port.messages) == 2 and len(shown.port.messages[1]) == 1


@pytest.mark.parametrize("visual, kind, size, colour", [
    (Visual("v", Box((1.0, 2.0, 3.0)), rgba=(0.1, 0.2, 0.3, 0.8), transparency=0.5), Marker.CUBE, (1, 2, 3),
     (0.1, 0.2, 0.3, 0.4)),
    (Visual("v", Sphere(0.5), material="Gazebo/Red"), Marker.SPHERE, (1, 1, 1), (1, 0, 0, 1)),
    (Visual("v", MeshFile("/a/b.dae", scale=(2.0, 2.0, 2.0))), Marker.MESH_RESOURCE, (2, 2, 2), (0.6, 0.6, 0.6, 1))])
def test_shape_and_colour_are_those_of_the_visual(visual, kind, size, colour):
    marker = visual_marker(visual)
    assert marker.type == kind and (marker.scale.x, marker.scale.y, marker.scale.z) == size
    assert (marker.color.r, marker.color.g, marker.color.b, marker.color.a) == pytest.approx(colour)
    assert marker.mesh_resource == ("file:///a/b.dae" if kind == Marker.MESH_RESOURCE else "")


@pytest.mark.parametrize("geometry", [Plane(), MeshFile(""), MeshFile("/a/b.dae", submesh="wheel")])
def test_what_a_marker_cannot_show_is_left_out(geometry):
    assert visual_marker(Visual("v", geometry)) is None


def test_models_with_mesh_files_have_looks_and_boxes_have_not(build):
    box = build.box("crate", 3.0, 0.0, 0.25, size=(0.5, 0.5, 0.5))
    mesh = replace(box, links=(replace(box.links[0], visuals=(Visual("v", MeshFile("/a/b.dae")),)),))
    assert has_looks(mesh) and not has_looks(box)
    assert [(marker.text, marker.header.frame_id) for marker in visual_markers("m", mesh)] == [
        ("model", "m::" + box.links[0].name)]
