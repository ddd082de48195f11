# SPDX-License-Identifier: BSD-3-Clause
"""The tours of the worlds: every way between two points has room for the robot."""
import glob
import os

import numpy as np
import pytest
import yaml

from launch_files import load
from m2wr_tools.map_comparison.agreement import Truth
from m2wr_tools.map_comparison.command import read_world

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..", "m2wr_sim")
START = (0.0, 8.0)              # of mapping.launch
CLEARANCE = 0.6                 # to the robot's axle [m]; it reaches 0.4 m from there
TOURS = sorted(glob.glob(os.path.join(FOLDER, "tours", "*.yaml")))


def way(path):
    """Points (K, 2), 5 cm apart, of the way of a tour."""
    with open(path) as stream:
        corners = np.array([START] + yaml.safe_load(stream)["way_points"])
    parts = [one + np.linspace(0.0, 1.0, max(2, int(np.hypot(*(two - one)) / 0.05)))[:, None] * (two - one)
             for one, two in zip(corners[:-1], corners[1:])]
    return np.concatenate(parts)


def test_the_worlds_with_walls_have_tours():
    names = [os.path.splitext(os.path.basename(path))[0] for path in TOURS]
    assert names == ["shapes", "unreachable", "world01", "world02", "world03"]


@pytest.mark.parametrize("path", TOURS, ids=os.path.basename)
def test_a_tour_keeps_away_from_what_stands_there(path):
    truth = Truth(read_world(os.path.splitext(os.path.basename(path))[0]))
    points = way(path)
    distances = truth.distances(points)
    nearest = distances.argmin()
    assert distances[nearest] > CLEARANCE, points[nearest]


@pytest.mark.parametrize("world", ["world01", "world02.world", os.path.join(FOLDER, "worlds", "world03.world")])
@pytest.mark.parametrize("factor", [1, 5])
def test_a_tour_is_driven_and_mapped(world, factor):
    nodes, params = load("mapping.launch", "drive:=tour", "world:=" + world, "real_time_factor:=%d" % factor,
                         "exit_on_goal:=true", "map:=/tmp/plan")
    assert sorted(nodes) == ["compare_map", "gazebo", "m2wr_spawn", "robot_state_publisher", "slam_gmapping", "tour"]
    assert nodes["tour"].required and params["/tour/exit_at_end"] is True
    assert len(params["/tour/way_points"]) > 5
    assert params["/tour/lockstep"] is params["/gazebo/lockstep"] is (factor != 1)
    assert params["/gazebo/lockstep_controllers"] == ["/tour"]
    assert params["/slam_gmapping/save_on_exit"] == "/tmp/plan"


def test_way_points_of_another_file_are_taken(tmp_path):
    (tmp_path / "way.yaml").write_text("way_points: [[1, 2], [3, 4]]\n")
    _, params = load("mapping.launch", "drive:=tour", "tour:=%s" % (tmp_path / "way.yaml"))
    assert params["/tour/way_points"] == [[1, 2], [3, 4]]


@pytest.mark.parametrize("drive, driver", [("bug2", "bug2"), ("teleop", "teleop_twist_keyboard"), ("none", None)])
def test_other_drivers_take_no_tour(drive, driver):
    nodes, _ = load("mapping.launch", "drive:=" + drive, "world:=empty.world")
    assert "tour" not in nodes and "slam_gmapping" in nodes
    assert {name for name in nodes if name in ("bug2", "teleop_twist_keyboard")} == ({driver} if driver else set())


def test_of_two_words_for_one_argument_the_last_holds():
    """The demo puts the user's words behind its own."""
    nodes, _ = load("mapping.launch", "drive:=tour", "drive:=none")
    assert "tour" not in nodes
