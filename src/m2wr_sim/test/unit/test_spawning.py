# SPDX-License-Identifier: BSD-3-Clause
"""Spawning beside the loop: what is read where, what is refused for its size, what a URDF's <surface> counts for."""
import gc
import logging
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import Pose

from m2wr_sim.model.mesh import files as mesh_files
from m2wr_sim.model.types import Mesh
from m2wr_sim.ros.gazebo_services import spawning
from m2wr_sim.ros.gazebo_services.spawning import Spawner
from m2wr_sim.sensors import mesh_tree
from test_mesh_files import PYRAMID, text_stl

SDF = '<sdf version="1.6"><model name="m"><static>1</static>%s</model></sdf>'
LINK = ('<link name="%s"><collision name="c"><geometry>%s</geometry></collision></link>')
CASTER = """<robot name="r"><link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1"
iyz="0" izz="1"/></inertial><collision><geometry><sphere radius="0.1"/></geometry><surface><friction><ode><mu>0</mu>
<mu2>0</mu2><slip1>1</slip1></ode></friction></surface></collision></link></robot>"""


def request(text, name="thing"):
    return SimpleNamespace(model_xml=text, model_name=name, initial_pose=Pose(), reference_frame="", robot_namespace="")


@pytest.fixture
def rig(make_rig):
    """Return a simulation with a spawner, and the list of what it did: ``in`` and ``out`` of the loop, other steps."""
    rig = make_rig()
    rig.done = []
    rig.spawner = Spawner(rig.simulator)

    def in_loop(function):
        rig.done.append("in")
        try:
            return function()
        finally:
            rig.done.append("out")

    rig.spawner.in_loop = in_loop
    return rig


def test_texts_and_meshes_are_read_beside_the_loop(rig, tmp_path, monkeypatch):
    path = tmp_path / "a.stl"
    path.write_bytes(text_stl(PYRAMID))
    for module, name in ((mesh_files, "_checked"), (mesh_tree, "build_tree"), (spawning, "load_sdf"),
                         (spawning.native_shapes, "_MeshData")):
        def noted(*arguments, _original=getattr(module, name), _name=name, **options):
            rig.done.append(_name)
            return _original(*arguments, **options)
        monkeypatch.setattr(module, name, noted)
    answer = rig.spawner.spawn_sdf_model(request(SDF % LINK % ("l", "<mesh><uri>%s</uri></mesh>" % path)))
    assert answer.success, answer.status_message
    assert rig.done == ["in", "out", "load_sdf", "_checked", "_MeshData", "build_tree", "in", "out"]
    assert isinstance(rig.simulator.models["thing"].record.links[0].collisions[0].geometry, Mesh)


def test_prepared_shapes_are_those_the_scene_takes():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]], np.int32), "a")
    tree = mesh_tree.tree_of(mesh)
    assert mesh_tree.Forest().add(mesh)[1] is tree is mesh_tree.tree_of(mesh)


@pytest.mark.parametrize("text", [
    SDF % "".join(LINK % ("l%d" % index, "<sphere><radius>1</radius></sphere>") for index in range(3)),
    SDF % ('<model name="n">' + LINK % ("a", "<sphere><radius>1</radius></sphere>") + "</model>" + "".join(
        '<link name="l%d"/>' % index for index in range(4)))])
def test_a_model_of_too_many_parts_is_refused_with_the_limit(rig, monkeypatch, text):
    monkeypatch.setattr(spawning, "_MOST_PARTS", 5)
    answer = rig.spawner.spawn_sdf_model(request(text))
    assert not answer.success and "at most 5" in answer.status_message and rig.done == ["in", "out"]
    monkeypatch.setattr(spawning, "_MOST_PARTS", 6)
    assert rig.spawner.spawn_sdf_model(request(text)).success


def test_a_urdf_of_too_many_parts_is_refused_too(rig, monkeypatch):
    monkeypatch.setattr(spawning, "_MOST_PARTS", 1)
    answer = rig.spawner.spawn_urdf_model(request(CASTER))
    assert not answer.success and '"thing" has 2 links and collisions; expected at most 1' in answer.status_message


@pytest.mark.parametrize("mode, friction", [("honour", (0.0, 0.0, 1.0)), ("gazebo", (1.0, 1.0, 0.0))])
def test_surface_in_a_urdf_counts_as_the_parameter_says(make_rig, caplog, mode, friction):
    caplog.set_level(logging.INFO)
    rig = make_rig()
    assert Spawner(rig.simulator, urdf_surface=mode).spawn_urdf_model(request(CASTER)).success
    surface = rig.simulator.models["thing"].record.links[0].collisions[0].surface
    assert (surface.mu, surface.mu2, surface.slip1) == friction
    assert ("ignored" if mode == "gazebo" else "are applied here") in caplog.text


def test_garbage_collection_is_off_while_a_long_text_is_read(rig, monkeypatch):
    monkeypatch.setattr(spawning, "_LONG_TEXT", 10)
    states = []
    original = spawning.load_sdf
    monkeypatch.setattr(spawning, "load_sdf", lambda *given, **named: states.append(gc.isenabled()) or original(
        *given, **named))
    assert rig.spawner.spawn_sdf_model(request(SDF % '<link name="l"/>')).success
    assert not rig.spawner.spawn_sdf_model(request("<sdf><broken", "other")).success
    assert states == [False, False] and gc.isenabled()
    gc.unfreeze()


def test_a_model_with_bad_parts_is_spawned_an_empty_one_refused(rig, caplog):
    assert rig.spawner.spawn_sdf_model(request(SDF % LINK % ("l", "<pyramid/>"))).success
    assert 'unknown geometry "pyramid"' in caplog.text and "this collision is left out" in caplog.text
    answer = rig.spawner.spawn_sdf_model(request(
        '<sdf version="1.6"><model name="m"><link name="l"><inertial><mass>0</mass></inertial></link></model></sdf>',
        "other"))
    assert not answer.success and "mass is 0; expected a positive mass in kg" in answer.status_message
    assert list(rig.simulator.models)[-1] == "thing"


# ---- untrusted text

def test_xacro_over_a_service_is_refused_with_a_hint(rig, tmp_path):
    target = tmp_path / "owned"
    text = ('<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="'
            '${(lambda: open(\'%s\', \'w\'))()}"/></robot>' % target)
    for answer in (rig.spawner.spawn_urdf_model(request(text)), rig.spawner.spawn_sdf_model(request(text))):
        assert not answer.success and "xacro FILE.xacro > FILE.urdf" in answer.status_message
    assert not target.exists()


@pytest.mark.parametrize("text, words", [
    ("<robot>" + " " * (spawning.MOST_TEXT + 1), "characters; expected at most"),
    ("<robot>" + "<a/>" * (spawning.MOST_MARKS + 1), "tags and attributes; expected at most"),
    ("<robot>" + "&" * (spawning.MOST_MARKS + 1), "tags and attributes; expected at most"),
    ("<sdf>" + " " * (spawning.MOST_TEXT + 1), "characters; expected at most"),
    ("<sdf>" + "<a/>" * (spawning.MOST_MARKS + 1), "tags and attributes; expected at most")])
def test_a_text_that_is_too_large_is_refused_before_it_is_parsed(rig, monkeypatch, text, words):
    monkeypatch.setattr(spawning, "load_urdf", None)
    monkeypatch.setattr(spawning, "load_sdf", None)
    for spawn in (rig.spawner.spawn_urdf_model, rig.spawner.spawn_sdf_model):
        answer = spawn(request(text))
        assert not answer.success and words in answer.status_message
