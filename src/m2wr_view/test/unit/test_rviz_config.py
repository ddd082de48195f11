# SPDX-License-Identifier: BSD-3-Clause
"""rviz configurations for pictures, and those of this workspace: what they show, by topics, tools and cameras."""
import math
import os

import numpy as np
import pytest
import yaml

from m2wr_view.errors import ViewError
from m2wr_view.rviz_config import YAW, for_pictures

SOURCES = os.path.join(os.path.dirname(os.path.abspath(__file__)), *[os.pardir] * 3)
FILES = {"robot": "m2wr_description/rviz/m2wr.rviz", "model": "m2wr_description/rviz/model.rviz",
         "bug2": "motion_plan/rviz/bug2.rviz", "mapping": "m2wr_gmapping/rviz/mapping.rviz",
         "any": "m2wr_sim/rviz/sim.rviz", "robots": "m2wr_sim/rviz/robots.rviz"}
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
    # with several robots there is no common goal
    assert tools.get("rviz/SetGoal") == (None if name == "robots" else "/move_base_simple/goal")


@pytest.mark.parametrize("name, frame, shown", [
    ("robot", "odom", {"/m2wr/laser/scan", "/odom", "/gazebo/world_markers"}),
    ("bug2", "odom", {"/m2wr/laser/scan", "/odom", "/gazebo/world_markers", "/bug2/markers"}),
    ("any", "odom", {"/scan", "/odom", "/gazebo/world_markers"}),
    ("mapping", "map", {"/map", "/m2wr/laser/scan", "/slam_gmapping/path", "/slam_gmapping/particles",
                        "/bug2/markers"}),
    ("robots", "world", {"/gazebo/world_markers", "/robot1/odom", "/robot4/m2wr/laser/scan"})])
def test_what_a_configuration_shows(name, frame, shown):
    manager = config(name)["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] == frame
    topics = {display.get("Topic", display.get("Marker Topic")) for display in manager["Displays"]
              if display["Value"]}
    assert shown <= topics
    assert {"rviz/RobotModel", "rviz/TF"} <= {display["Class"] for display in manager["Displays"]}


# ---- what the cameras see ----------------------------------------------------------------------------------------

PICTURE = (1280, 720)       # pixels, of the virtual display
FIELD_OF_VIEW = 0.785       # rad, of rviz, from the lower to the upper edge
LETTER_WIDTH = 0.42         # of their height, of rviz's letters; measured 0.38 for "link_right_wheel"


def current(name):
    return config(name)["Visualization Manager"]["Views"]["Current"]


def pixels_of_orbit(view, points):
    """Columns and rows (n, 2) of points (n, 3) [m] in a picture, and pixels a metre there (n,)."""
    yaw, pitch = view["Yaw"], view["Pitch"]
    back = np.array((math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)))
    right = np.array((-math.sin(yaw), math.cos(yaw), 0.0))
    axes = np.stack((right, np.cross(back, right), back))
    focal = np.array([view["Focal Point"][axis] for axis in "XYZ"])
    seen = (np.asarray(points, float) - focal - view["Distance"] * back).dot(axes.T)
    scale = 0.5 * PICTURE[1] / math.tan(0.5 * view.get("Field of View", FIELD_OF_VIEW)) / -seen[:, 2]
    return np.array(PICTURE) / 2.0 + seen[:, :2] * scale[:, None] * (1.0, -1.0), scale


ORBITS = sorted(name for name in FILES if current(name)["Class"] == "rviz/Orbit" and name != "model")


@pytest.mark.parametrize("yaw", [YAW] + [current(name)["Yaw"] for name in ORBITS], ids=["derived"] + ORBITS)
def test_no_camera_looks_along_the_walls(yaw):
    # rviz's light shines along the camera's axis: a face along that axis is black
    assert abs(math.sin(yaw)) > 0.5 and abs(math.cos(yaw)) > 0.5


def test_the_course_of_bug2_is_in_view():
    course = [(x, y, 0.0) for x in (-5.2, 6.0) for y in (8.2, -4.5)]      # start, goal, and the way between them
    (columns, rows), scale = pixels_of_orbit(current("bug2"), course)[0].T, pixels_of_orbit(current("bug2"), course)[1]
    assert columns.min() > 20 and columns.max() < PICTURE[0] - 20 and rows.min() > 40 and rows.max() < PICTURE[1] - 20
    assert 0.5 * scale.min() > 20       # pixels: m2wr is 0.5 m long


def test_the_world_is_in_view_of_the_map():
    view = current("mapping")
    assert PICTURE[1] / view["Scale"] > 20.0 + 2.0 * max(abs(view["X"]), abs(view["Y"]))       # m


def test_names_of_frames_do_not_overlap():
    names, places = zip(*(("link_chassis", (0.0, 0.0, 0.0)), ("link_right_wheel", (-0.05, 0.2, 0.0)),
                          ("link_left_wheel", (-0.05, -0.2, 0.0)), ("sensor_laser", (0.15, 0.0, 0.05))))
    shown = next(display for display in config("model")["Visualization Manager"]["Displays"]
                 if display["Class"] == "rviz/TF")
    middles, scale = pixels_of_orbit(current("model"), places)
    heights = 0.1 * shown["Marker Scale"] * scale           # rviz's letters: 0.1 m, times the scale
    halves = [0.5 * LETTER_WIDTH * height * len(name) for name, height in zip(names, heights)]
    boxes = [(x - half, y, x + half, y + 1.3 * height) for (x, y), half, height in zip(middles, halves, heights)]
    assert heights.min() > 18                               # pixels
    for number, (left, upper, right, lower) in enumerate(boxes):
        assert left > 0 and upper > 0 and right < PICTURE[0] and lower < PICTURE[1]
        for other, (x0, y0, x1, y1) in enumerate(boxes[:number]):
            assert right < x0 or x1 < left or lower < y0 or y1 < upper, (names[number], names[other])
