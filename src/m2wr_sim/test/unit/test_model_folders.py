# SPDX-License-Identifier: BSD-3-Clause
"""Where models and other files are found: the environment, what this package ships, and what packages export."""
import pytest

from m2wr_sim.model.model_folders import ModelFolders, exported_paths, standard_folders
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.model.xml.safe import XmlError

EXPORT = '<package format="2"><name>{0}</name><export><gazebo_ros {1}="{2}"/></export></package>'


@pytest.fixture
def places(tmp_path):
    """Return a function that makes folders with a model or file in them and gives their paths."""
    def make(place, *names):
        for name in names:
            path = tmp_path / place / name
            if "." in name:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text("file")
            else:
                path.mkdir(parents=True)
                (path / "model.sdf").write_text("<sdf/>")
        return str(tmp_path / place)
    return make


@pytest.fixture
def package(tmp_path):
    """Return a function that makes a package which exports a path; returns its folder."""
    def make(name, attribute, value):
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / "package.xml").write_text(EXPORT.format(name, attribute, value))
        return str(tmp_path / name)
    return make


def test_the_order_is_home_environment_own_packages(places, package, monkeypatch):
    home = places("home/.gazebo/models", "a", "b")
    monkeypatch.setenv("HOME", home[:-len("/.gazebo/models")])
    listed, own = places("listed", "a", "b", "c"), places("share/models", "b", "c", "d")
    exported, stand_ins = places("pkg/models", "d", "e"), places("share/stand_ins", "e", "f")
    folders = standard_folders(own[:-len("/models")], {"GAZEBO_MODEL_PATH": ":/nowhere:%s:" % listed},
                               lambda: [package("pkg", "gazebo_model_path", "${prefix}/models")])
    found = {name: folders("model://" + name) for name in "abcdefg"}
    assert found == {"a": home + "/a/model.sdf", "b": home + "/b/model.sdf", "c": listed + "/c/model.sdf",
                     "d": own + "/d/model.sdf", "e": exported + "/e/model.sdf", "f": stand_ins + "/f/model.sdf",
                     "g": None}
    assert {name: folders.stood_in(found[name]) for name in "aef"} == {"a": "", "e": "", "f": "f"}


def test_names_are_those_of_all_folders_with_a_model(places, package):
    own, exported = places("share/models", "b", "a"), places("exporting/models", "c", "b")
    places("share/models", "picture.png")
    folders = ModelFolders(["/nowhere", own], packages=lambda: [
        package("exporting", "gazebo_model_path", exported)])
    assert folders.names(10) == ["a", "b", "c"]
    assert folders.names(2) == ["a", "b"]


def test_a_message_names_few_folders():
    assert str(ModelFolders(["/%d" % index for index in range(40)])) == (
        "/0, /1, /2, /3, /4, and 35 folders that packages or GAZEBO_MODEL_PATH name")
    assert str(ModelFolders(["/a", "/b"])) == "/a, /b" and str(ModelFolders()) == "no folders"


def test_packages_are_searched_once_and_last(places):
    asked = []
    folders = ModelFolders([places("own", "a")], packages=lambda: asked.append(1) or [])
    assert folders("model://a") and not asked
    assert folders("model://b") is None and folders("model://c") is None and asked == [1]


def test_media_and_relative_paths_count_from_the_resources(places, package):
    resources, exported = places("res", "media/a.dae"), places("pkg", "media/b.dae")
    folders = ModelFolders([], [resources], lambda: [package("pkg", "gazebo_media_path", "${prefix}:/nowhere")])
    assert folders("file://media/a.dae") == folders("media/a.dae") == resources + "/media/a.dae"
    assert folders("file://media/b.dae") == exported + "/media/b.dae"
    assert folders("file://%s/media/a.dae" % resources) == resources + "/media/a.dae"
    assert folders("file://media/c.dae") is None and folders("https://example.com/media/a.dae") is None


def test_exports_with_several_folders_and_without_any(package, tmp_path):
    (tmp_path / "empty").mkdir()
    broken = package("broken", "gazebo_model_path", "x")
    (tmp_path / "broken" / "package.xml").write_text("<package gazebo_model_path=")
    two = package("two", "gazebo_model_path", "${prefix}/models:${prefix}/../shared")
    other = package("other", "plugin_path", "${prefix}/lib")
    assert exported_paths([str(tmp_path / "empty"), broken, other, two], "gazebo_model_path") == [
        two + "/models", str(tmp_path / "shared")]


@pytest.mark.parametrize("uri", ["model://../../etc/passwd", "model://a/../../x", "file://media/../../x", "../x",
                                 "file:///a/../etc/passwd"])
def test_paths_that_leave_their_folder_are_rejected(places, uri):
    with pytest.raises(XmlError, match="leaves the model's folder"):
        ModelFolders([places("own", "a")], [places("res", "media/a.dae")])(uri)


@pytest.mark.parametrize("listed, taken", [(("1.5", "1.8", "1.7"), "1.7"), (("1.10", "1.8"), "1.8"), (("1.9",), "1.9")])
def test_newest_supported_version_is_used_else_the_oldest(tmp_path, listed, taken):
    folder = tmp_path / "m"
    folder.mkdir()
    for version in listed:
        (folder / (version + ".sdf")).write_text("<sdf/>")
    (folder / "model.config").write_text("<model>%s</model>" % "".join(
        '<sdf version="%s">%s.sdf</sdf>' % (version, version) for version in listed))
    assert ModelFolders([str(tmp_path)])("model://m") == str(folder / (taken + ".sdf"))


def test_a_folder_of_material_scripts_is_found_by_its_uri(tmp_path):
    scripts = tmp_path / "wall" / "materials" / "scripts"
    scripts.mkdir(parents=True)
    folders = ModelFolders([str(tmp_path)])
    assert folders.folder("model://wall/materials/scripts") == str(scripts)
    assert folders.folder("model://wall/materials/textures") is None
    with pytest.raises(XmlError, match=r"\.\."):
        folders.folder("model://../etc")
    text = """<sdf version="1.6"><world name="w"><model name="m"><static>1</static><link name="l"><visual name="v">
        <geometry><box><size>1 1 1</size></box></geometry><material><script>
        <uri>model://wall/materials/scripts</uri><uri>model://wall/../..</uri><name>a/b</name></script></material></visual>
        </link></model></world></sdf>"""
    visual = load_world(text, "w.world", folders).models[0].links[0].visuals[0]
    assert (visual.scripts, visual.material) == ((str(scripts),), "a/b")


# ---- models on a Fuel server

FUEL = "https://fuel.gazebosim.org/1.0/OpenRobotics/models/"


def fuel_model(cache, version):
    folder = cache / "fuel.gazebosim.org" / "openrobotics" / "models" / "ground plane" / version
    folder.mkdir(parents=True)
    (folder / "model.sdf").write_text("<sdf version='1.6'/>")
    return str(folder / "model.sdf")


def test_a_fuel_model_is_taken_from_the_caches_else_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    stand_ins = tmp_path / "stand_ins" / "ground_plane"
    stand_ins.mkdir(parents=True)
    (stand_ins / "model.sdf").write_text("<sdf version='1.6'/>")
    folders = ModelFolders([], stand_ins=str(tmp_path / "stand_ins"))
    assert folders(FUEL + "Ground%20Plane") == folders(FUEL + "Ground Plane") == str(stand_ins / "model.sdf")
    cache = tmp_path / ".ignition" / "fuel"
    old, new = fuel_model(cache, "9"), fuel_model(cache, "10")
    assert folders(FUEL + "Ground Plane") == folders(FUEL + "Ground Plane/tip") == new
    assert folders(FUEL + "Ground Plane/9") == folders(FUEL + "Ground Plane/9/files/model.sdf") == old
    assert folders(FUEL + "Sun") is None


@pytest.mark.parametrize("uri", [
    FUEL, "https://fuel.gazebosim.org/1.0/OpenRobotics/worlds/Ground Plane", "https://[broken/1.0/a/models/b",
    "https:///1.0/a/models/b", FUEL + "a%2fb", FUEL + "a\0b"])
def test_other_addresses_name_no_model(uri):
    assert ModelFolders([])(uri) is None


@pytest.mark.parametrize("uri", [FUEL + "..", FUEL + "%2e%2e", FUEL + "a/1/files/../../b",
                                 "https://fuel.gazebosim.org/1.0/../models/a"])
def test_addresses_that_leave_their_folder_are_rejected(uri):
    with pytest.raises(XmlError, match="leaves the model's folder"):
        ModelFolders([])(uri)
