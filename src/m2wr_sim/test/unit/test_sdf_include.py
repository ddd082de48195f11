# SPDX-License-Identifier: BSD-3-Clause
"""Includes of SDF: which file is found, what an include overrides, and includes that are skipped."""
import pytest

from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_sdf_models
from sdf_documents import LINK, static, told, world


@pytest.fixture
def folders(tmp_path):
    def add(name, sdf, config='<model><sdf version="1.6">model.sdf</sdf></model>', file="model.sdf"):
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / file).write_text(sdf)
        if config:
            (tmp_path / name / "model.config").write_text(config)

    finder = ModelFolders(["/nonexistent", str(tmp_path)])
    finder.add = add
    add("post", '<sdf version="1.6"><model name="post"><pose>9 9 9 0 0 0</pose>{}</model></sdf>'.format(LINK))
    return finder


def include(uri, body=""):
    return "<include><uri>{}</uri>{}</include>".format(uri, body)


def test_include_overrides_name_pose_static_and_adds_plugins(folders):
    own = "<name>p2</name><pose>1 2 3 0 0 0</pose><static>true</static><plugin name='x' filename='libx.so'/>"
    loaded = world(include("model://post"), include("model://post", own),
                   include("model://post", "<pose>5 5 5 0 0 0</pose>"), resolve_model=folders)
    first, second = loaded.models
    assert (first.name, first.pose[0], first.static) == ("post", (9.0, 9.0, 9.0), False)
    assert (second.name, second.pose[0], second.static) == ("p2", (1.0, 2.0, 3.0), True)
    assert [plugin.name for plugin in second.plugins] == ["x"] and first.plugins == ()
    note, = loaded.notes
    assert 'a model "post" is there already' in note


def test_a_model_that_includes_only_static_ones_is_static(folders):
    folders.add("wall", '<sdf version="1.6"><model name="wall"><static>true</static>{}</model></sdf>'.format(LINK))
    own = include("model://post", "<static>true</static>")
    fixed, moving = world('<model name="fixed">{}{}</model>'.format(include("model://wall"), own),
                          '<model name="moving">{}{}</model>'.format(include("model://wall"), include("model://post")),
                          resolve_model=folders).models
    assert fixed.static and not moving.static
    assert [link.kinematic for link in moving.links] == [True, False]


def test_an_include_from_a_fuel_server_is_a_local_model(folders):
    uri = "https://fuel.gazebosim.org/1.0/owner/models/Post"
    loaded = world(include(uri), include(uri, "<name>other</name>"), resolve_model=folders)
    assert [found.name for found in loaded.models] == ["post", "other"]
    note, = loaded.notes
    assert note.startswith(uri + " is not downloaded; using ")


def test_newest_sdf_that_can_be_read_is_taken(folders):
    folders.add("v", '<sdf version="1.7"><model name="seven">{}</model></sdf>'.format(LINK), None, "seven.sdf")
    folders.add("v", '<sdf version="1.4"><model name="four">{}</model></sdf>'.format(LINK), """<model>
      <sdf version="1.4">four.sdf</sdf><sdf version="1.7">seven.sdf</sdf><sdf version="1.10">ten.sdf</sdf></model>""",
                "four.sdf")
    assert [found.name for found in world(include("model://v"), resolve_model=folders).models] == ["seven"]


def test_missing_model_is_reported_with_the_searched_folders(folders):
    loaded = world(include("model://nothing"), include("https://example.com/x"), static("m"), resolve_model=folders)
    assert [found.name for found in loaded.models] == ["m"]
    assert "model://nothing" in loaded.notes[0] and "/nonexistent" in loaded.notes[0] and "a.world:3" in loaded.notes[0]
    assert "https://example.com/x" in loaded.notes[1] and "nothing is downloaded" in loaded.notes[1]


@pytest.mark.parametrize("uri", ["model://../../etc", "model://post/../../x.sdf", "file:///tmp/../etc/x.sdf"])
def test_includes_outside_the_folder_are_skipped(folders, uri):
    loaded, note = told(include(uri), resolve_model=folders)
    assert '".."' in note and "this include is left out" in note and uri in note and len(loaded.models) == 1


def test_a_config_that_points_outside_costs_its_include(folders):
    folders.add("bad", "<sdf/>", '<model><sdf version="1.6">../post/model.sdf</sdf></model>')
    assert '".."' in told(include("model://bad"), resolve_model=folders)[1]


def test_cyclic_includes_are_skipped(folders):
    nested = '<sdf version="1.6"><model name="{0}">{1}<include><uri>model://{2}</uri></include></model></sdf>'
    folders.add("one", nested.format("one", LINK, "two"))
    folders.add("two", nested.format("two", LINK, "one"))
    loaded, note = told(include("model://one"), resolve_model=folders)
    assert "model://one includes itself" in note and "two/model.sdf" in note and "this include is left out" in note
    assert [link.name for link in loaded.models[0].links] == ["link", "two::link"]


def test_include_in_a_model_inherits_static(folders):
    folders.add("row", '<sdf version="1.6"><model name="row"><static>true</static>' + "".join(
        include("model://post", "<name>p{0}</name><pose>{0} 0 0 0 0 0</pose>".format(index)) for index in (1, 2)) +
        "</model></sdf>")
    found, = world(include("model://row", "<pose>0 0 1 0 0 0</pose>"), resolve_model=folders).models
    assert found.static and found.nested == ("p1", "p2")
    assert [(link.name, link.pose[0]) for link in found.links] == [("p1::link", (1.0, 0.0, 0.0)),
                                                                   ("p2::link", (2.0, 0.0, 0.0))]


@pytest.mark.parametrize("text, words", [
    ("<sdf>\n<model>", "broken/model.sdf:2: not well-formed"), ("<robot/>", "expected <sdf>"),
    ('<sdf version="1.6"><model name="m"><link name="l"><inertial><mass>-1</mass></inertial></link></model></sdf>',
     "mass is -1"), ('<sdf version="1.6"><model/></sdf>', "attribute name is missing")])
def test_unusable_included_file_is_reported_once(folders, text, words):
    folders.add("broken", text)
    twice = include("model://broken") + "\n" + include("model://broken", "<name>other</name>")
    loaded, note = told(twice, resolve_model=folders)
    assert words in note and "this include is left out" in note and len(loaded.models) == 1


def test_database_form_of_spawning(folders):
    text = '<sdf version="1.6"><world name="default">{}</world></sdf>'.format(include("model://post"))
    found, = load_sdf_models(text, "x", folders)
    assert found.name == "post"


def test_lights_with_three_and_four_colours_and_in_an_include(folders):
    folders.add("lamp", '<sdf version="1.6"><light name="lamp" type="spot"><attenuation><linear>0.5</linear>'
                '</attenuation><direction>1 0 0</direction></light></sdf>')
    loaded = world('<light name="a" type="directional"><cast_shadows>true</cast_shadows><pose>0 0 10 0 0 0</pose>'
                   '<diffuse>0.5 0.25 0</diffuse><specular>1 1 1 0.5</specular></light>',
                   include("model://lamp", "<name>b</name>"), static("m"), resolve_model=folders)
    first, second = loaded.lights
    assert (first.name, first.kind, first.cast_shadows, first.pose[0]) == ("a", "directional", True, (0.0, 0.0, 10.0))
    assert first.diffuse == (0.5, 0.25, 0.0, 1.0) and first.specular == (1.0, 1.0, 1.0, 0.5)
    assert (second.name, second.kind, second.attenuation, second.direction) == (
        "b", "spot", (1.0, 0.5, 0.0), (1.0, 0.0, 0.0))
    assert [found.name for found in loaded.models] == ["m"] and loaded.notes == ()


def merging(body="", name="tower", version="1.9"):
    """A model that includes another one by merge; a second link and a joint."""
    return """<sdf version="{}"><model name="{}"><pose>0 0 1 0 0 0</pose><link name="base"><inertial><mass>1</mass>
      </inertial></link>{}</model></sdf>""".format(version, name, body)


@pytest.fixture
def head(folders):
    """A model of two links, a joint and a plugin, to include."""
    folders.add("head", """<sdf version="1.9"><model name="head"><link name="neck"/><link name="lens">
      <pose>0 0 0.1 0 0 0</pose></link><joint name="tilt" type="revolute"><parent>neck</parent><child>lens</child>
      <axis><xyz>0 1 0</xyz></axis></joint><plugin name="x" filename="libx.so"/></model></sdf>""".replace(
          '"/>', '"><inertial><mass>1</mass></inertial></link>', 1).replace(
              '<pose>0 0 0.1', '<inertial><mass>1</mass></inertial><pose>0 0 0.1'))
    return folders


PLACED = '<include merge="true"><uri>model://head</uri><pose>0 0 2 0 0 0</pose></include>'
JOINT = '<joint name="top" type="fixed"><parent>base</parent><child>neck</child></joint>'


def test_merge_keeps_names_and_poses(head):
    model, = load_sdf_models(merging(PLACED + JOINT), "a.sdf", resolve_model=head)
    assert [link.name for link in model.links] == ["base", "neck", "lens"] and model.nested == ()
    assert [link.pose[0][2] for link in model.links] == pytest.approx([0.0, 2.0, 2.1])
    assert [(joint.name, joint.parent, joint.child) for joint in model.joints] == [
        ("tilt", "neck", "lens"), ("top", "base", "neck")]
    plugin, = model.plugins
    assert (plugin.name, plugin.scope) == ("x", "")
    assert not [note for note in model.notes if "SDF version" not in note]


def test_without_merge_it_is_nested(head):
    model, = load_sdf_models(merging(PLACED.replace(' merge="true"', "")), "a.sdf", resolve_model=head)
    assert [link.name for link in model.links] == ["base", "head::neck", "head::lens"]
    assert model.plugins[0].scope == "head"


def test_merge_of_a_taken_name_is_left_out(head):
    model, = load_sdf_models(merging(PLACED + '<link name="lens"><inertial><mass>1</mass></inertial></link>'),
                             "a.sdf", resolve_model=head)
    assert [link.name for link in model.links] == ["base", "lens"]
    assert any('link "lens" of the merged model "head"' in note and "this include is left out" in note
               for note in model.notes)


def test_merge_in_a_world_is_reported(head):
    loaded = world(PLACED, resolve_model=head)
    assert [model.name for model in loaded.models] == ["head"]
    assert any("inside a <model>" in note for note in loaded.notes)
