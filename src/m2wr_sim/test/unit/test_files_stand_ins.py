# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for models of Gazebo's database: each has size, position and mass of the original, and is logged."""
import logging
import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from m2wr_sim.geometry import compose
from m2wr_sim.model.mesh.files import read_mesh_file
from m2wr_sim.model.model_folders import ModelFolders, standard_folders
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.types import Box, Cylinder
from m2wr_sim.model.xml.safe import parse_xml

PACKAGE = Path(__file__).resolve().parents[2]
MEASURED = yaml.safe_load((PACKAGE / "test" / "data" / "stand_ins.yaml").read_text(encoding="utf-8"))
FOLDER = PACKAGE / "stand_ins"
NEAR = 0.002                    # m; files carry four decimals, and a round foot is drawn a little wider
INCLUDE = '<sdf version="1.6"><world name="w">%s</world></sdf>'
INLINE = ('<model name="%s"><static>1</static><link name="l"><collision name="c"><geometry><mesh><uri>%s</uri></mesh>'
          '</geometry></collision></link></model>')


def half_size(shape):
    if isinstance(shape, Box):
        return 0.5 * np.array(shape.size)
    assert isinstance(shape, Cylinder)
    return np.array((shape.radius, shape.radius, 0.5 * shape.length))


def bounds(model):
    """Return the least and greatest corner of a model of upright primitives, in its own frame."""
    low, high = [], []
    for link in model.links:
        for part in link.collisions:
            place, turn = compose(link.pose, part.pose)
            assert turn == pytest.approx((0.0, 0.0, 0.0, 1.0))
            low.append(place - half_size(part.geometry))
            high.append(place + half_size(part.geometry))
    return np.min(low, axis=0), np.max(high, axis=0)


def read(name):
    path = FOLDER / name / "model.sdf"
    model, = load_sdf_models(path.read_text(encoding="utf-8"), str(path))
    assert model.notes == () and model.name == name
    return model


def test_every_stand_in_is_measured_and_says_where():
    assert set(MEASURED) == {folder.name for folder in FOLDER.iterdir()} and len(MEASURED) >= 20
    assert all(entry["from"].startswith("osrf/gazebo_models ") for entry in MEASURED.values())


@pytest.mark.parametrize("name", sorted(MEASURED))
def test_its_outer_size_and_place_are_those_of_the_original(name):
    low, high = bounds(read(name))
    assert low == pytest.approx(MEASURED[name]["min"], abs=NEAR)
    assert high == pytest.approx(MEASURED[name]["max"], abs=NEAR)


@pytest.mark.parametrize("name", sorted(MEASURED))
def test_it_is_as_heavy_and_as_movable_as_the_original(name):
    model, mass = read(name), MEASURED[name]["mass"]
    assert model.static == (mass == "static")
    if not model.static:
        assert model.links[0].inertial.mass == pytest.approx(mass, rel=1e-3)


@pytest.mark.parametrize("name, file", [(name, file) for name in sorted(MEASURED)
                                        for file in MEASURED[name].get("meshes", ())])
def test_its_mesh_files_have_the_size_of_the_originals(name, file):
    corners = np.concatenate([part.vertices for part in read_mesh_file(str(FOLDER / name / file))])
    assert corners.min(axis=0) == pytest.approx(MEASURED[name]["meshes"][file]["min"], abs=NEAR)
    assert corners.max(axis=0) == pytest.approx(MEASURED[name]["meshes"][file]["max"], abs=NEAR)


@pytest.mark.parametrize("name", sorted(MEASURED))
def test_it_is_marked_as_a_stand_in(name):
    text = (FOLDER / name / "model.config").read_bytes()
    assert "stand-in of the same outer size" in parse_xml(text, name).findtext("description")


def test_the_own_barrier_has_the_size_of_the_original():
    path = PACKAGE / "models" / "jersey_barrier" / "model.sdf"
    model, = load_sdf_models(path.read_text(encoding="utf-8"), str(path))
    boxes = [part for part in model.links[0].collisions if part.pose[1][3] > 0.999]     # the two plates lie within
    low = np.min([np.array(part.pose[0]) - half_size(part.geometry) for part in boxes], axis=0)
    high = np.max([np.array(part.pose[0]) + half_size(part.geometry) for part in boxes], axis=0)
    assert low == pytest.approx((-2.0327, -0.4054, 0.0), abs=NEAR)
    assert high == pytest.approx((2.0327, 0.4054, 1.143), abs=NEAR)


def test_a_world_gets_them_with_one_sentence_each(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    folders = standard_folders(str(PACKAGE), {"GAZEBO_MODEL_PATH": str(tmp_path / "listed")})
    names = "".join("<include><uri>model://%s</uri><name>m%d</name></include>" % (name, index)
                    for index, name in enumerate(["dumpster", "dumpster", "mailbox", "jersey_barrier"]))
    inline = INLINE % ("i", "model://dumpster/meshes/dumpster.dae") + INLINE % (
        "j", "model://construction_cone/meshes/construction_cone.dae")
    world = load_world(INCLUDE % (names + inline), "a.world", folders)
    assert [model.name for model in world.models] == ["m0", "m1", "m2", "m3", "i", "j"]
    assert all(len(model.links[0].collisions) > 0 for model in world.models)
    told = [note for note in world.notes if "stand-in" in note]
    assert [note.split(" ")[0] for note in told] == ["model://dumpster", "model://mailbox", "model://construction_cone"]
    assert all("is not installed; using the stand-in of the same outer size" in note and "GAZEBO_MODEL_PATH" in note
               for note in told)


def test_installed_model_comes_first_and_is_not_reported(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    folder = tmp_path / ".gazebo" / "models" / "mailbox"
    folder.mkdir(parents=True)
    (folder / "model.sdf").write_text('<sdf version="1.6"><model name="mailbox"><static>1</static><link name="own"/>'
                                      '</model></sdf>', encoding="utf-8")
    world = load_world(INCLUDE % "<include><uri>model://mailbox</uri></include>", "a.world",
                       standard_folders(str(PACKAGE), {}))
    assert world.models[0].links[0].name == "own" and world.notes == ()


def test_what_is_nowhere_is_reported_with_what_to_do():
    world = load_world(INCLUDE % "<include><uri>model://no_such_thing</uri></include>", "a.world",
                       ModelFolders(["/nowhere"], stand_ins=str(FOLDER)))
    note, = world.notes
    assert "model://no_such_thing was not found" in note and "GAZEBO_MODEL_PATH" in note and "~/.gazebo/models" in note


def test_they_stay_where_they_are_put(make_rig, caplog):
    caplog.set_level(logging.WARNING)
    folders = ModelFolders([str(PACKAGE / "models")], stand_ins=str(FOLDER))
    rows = "".join("<include><uri>model://%s</uri><pose>%d 0 0 0 0 0</pose></include>" % (name, 40 * index)
                   for index, name in enumerate(sorted(MEASURED)))
    rig = make_rig()
    floor = "<include><uri>model://ground_plane</uri></include>"
    rig.simulator.load_world(load_world(INCLUDE % (floor + rows), "a.world", folders))
    assert len(rig.simulator.models) == len(MEASURED) + 1
    before = {name: rig.pose(name)[0] for name in MEASURED}
    rig.run(1.0)
    for name, place in before.items():              # what can move settles where it stands
        if name != "cardboard_box":                 # its frame is in its middle, as in the original
            assert math.dist(place, rig.pose(name)[0]) < 0.02, name
