# SPDX-License-Identifier: BSD-3-Clause
"""rviz configurations for pictures, and those of this workspace: what they show, by topics and tools."""
import os

import pytest
import yaml

from m2wr_view.errors import ViewError
from m2wr_view.rviz_config import for_pictures

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), *[os.pardir] * 3)
FILES = {"robot": "m2wr_description/rviz/m2wr.rviz", "model": "m2wr_description/rviz/model.rviz",
         "bug2": "motion_plan/rviz/bug2.rviz", "mapping": "m2wr_gmapping/rviz/mapping.rviz",
         "any": "m2wr_sim/rviz/sim.rviz", "crowd": "m2wr_sim/rviz/robots.rviz"}
WINDOW = """
Panels: [{Class: rviz/Displays, Name: Displays}, {Class: rviz/Views, Name: Views}]
Visualization Manager:
  Displays: [{Class: rviz/Grid, Name: Floor}]
  Global Options: {Fixed Frame: odom, Frame Rate: 30}
  Views: {Current: {Class: rviz/XYOrbit, Target Frame: odom}}
Window Geometry: {Height: 900, Width: 700}
"""


def config(name):
    with open(os.path.join(SOURCES, FILES[name]), encoding="utf-8") as stream:
        return yaml.safe_load(stream)


def derived(**options):
    return yaml.safe_load(for_pictures(WINDOW, "window.rviz", (640, 480), 10.0, **options))


def test_the_window_fills_the_screen_and_panels_are_hidden():
    geometry = derived()["Window Geometry"]
    assert (geometry["X"], geometry["Y"], geometry["Width"], geometry["Height"]) == (0, 0, 640, 480)
    assert geometry["Hide Left Dock"] is geometry["Hide Right Dock"] is True
    assert geometry["Displays"] == geometry["Views"] == {"collapsed": True}


@pytest.mark.parametrize("rate, expected", [(10.0, 10), (2.5, 2), (60.0, 30), (0.5, 1)])
def test_the_frame_rate_is_limited_and_a_whole_number(rate, expected):
    found = yaml.safe_load(for_pictures(WINDOW, "w", (640, 480), rate))["Visualization Manager"]["Global Options"]
    assert found["Frame Rate"] == expected and isinstance(found["Frame Rate"], int)
    assert found["Fixed Frame"] == "odom"


def test_the_camera_follows_a_frame_or_stays_as_it_is():
    kept = derived(view="orbit")["Visualization Manager"]["Views"]
    assert kept == {"Current": {"Class": "rviz/XYOrbit", "Target Frame": "odom"}}
    orbit = derived(view="orbit", frame="base", distance=5.0)["Visualization Manager"]["Views"]["Current"]
    assert (orbit["Class"], orbit["Target Frame"], orbit["Distance"]) == ("rviz/Orbit", "base", 5.0)
    top = derived(view="top", frame="base", distance=6.0)["Visualization Manager"]["Views"]["Current"]
    assert (top["Class"], top["Target Frame"], top["Scale"]) == ("rviz/TopDownOrtho", "base", 40.0)   # 480 / 12 m


@pytest.mark.parametrize("text", ["", "a: [", "[1, 2]", "Panels: []", "Visualization Manager: 3"])
def test_what_is_no_configuration_is_named(text):
    with pytest.raises(ViewError, match="rviz configuration lost.rviz"):
        for_pictures(text, "lost.rviz", (640, 480), 10.0)


def test_an_unknown_view_is_named():
    with pytest.raises(ViewError, match="'bird'.*orbit, top, config"):
        derived(view="bird")


@pytest.mark.parametrize("name", sorted(FILES))
def test_every_configuration_can_be_derived_from(name):
    text = for_pictures(yaml.safe_dump(config(name)), name, (640, 480), 10.0, "top", "link_chassis")
    assert yaml.safe_load(text)["Visualization Manager"]["Displays"] == \
        config(name)["Visualization Manager"]["Displays"]


@pytest.mark.parametrize("name", sorted(set(FILES) - {"model"}))
def test_tools_to_send_to_place_and_to_point_are_there(name):
    tools = {tool["Class"]: tool.get("Topic") for tool in config(name)["Visualization Manager"]["Tools"]}
    assert tools["rviz/SetInitialPose"] == "/initialpose" and tools["rviz/PublishPoint"] == "/clicked_point"
    # none of a crowd drives to goals
    assert tools.get("rviz/SetGoal") == (None if name == "crowd" else "/move_base_simple/goal")


@pytest.mark.parametrize("name, frame, shown", [
    ("robot", "odom", {"/m2wr/laser/scan", "/odom", "/gazebo/world_markers"}),
    ("bug2", "odom", {"/m2wr/laser/scan", "/odom", "/gazebo/world_markers", "/bug2/markers"}),
    ("any", "odom", {"/scan", "/odom", "/gazebo/world_markers"}),
    ("mapping", "map", {"/map", "/m2wr/laser/scan", "/slam_gmapping/path", "/slam_gmapping/particles",
                        "/bug2/markers"}),
    ("crowd", "world", {"/gazebo/world_markers", "/robot1/odom", "/robot4/m2wr/laser/scan"})])
def test_what_a_configuration_shows(name, frame, shown):
    manager = config(name)["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == frame
    topics = {display.get("Topic", display.get("Marker Topic")) for display in manager["Displays"]
              if display["Value"]}
    assert shown <= topics
    assert {"rviz/RobotModel", "rviz/TF"} <= {display["Class"] for display in manager["Displays"]}
