# SPDX-License-Identifier: BSD-3-Clause
"""The end of an exploration by a team: what is told, and the saved map."""
import numpy as np
import pytest
import rospy

from m2wr_exploration.crew import Crew
from m2wr_exploration.explorer import PARAMETERS, Explorer
from m2wr_exploration.registry import find
from m2wr_exploration.ros.team_report import TeamReport
from m2wr_exploration.study.scenes import whole_map
from m2wr_exploration.team.merging import merge
from m2wr_maps.saved_map_reader import read_map
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint import placed
from m2wr_navigation.parameters import read
from m2wr_sim.api import read_world


@pytest.fixture
def said(monkeypatch):
    found = []
    for name in ("loginfo", "logwarn", "logerr"):
        monkeypatch.setattr(rospy, name, lambda text, *args: found.append(text % args))
    return found


def crew():
    kind = find("tour")
    made = Crew(["robot1", "robot2"], [Explorer(read(PARAMETERS, {}, "")[0], kind(read(kind.PARAMETERS, {}, "")[0]))
                                       for _ in range(2)])
    for member, length in zip(made.members, (3.0, 4.25)):
        member.length, member.explorer.summary = length, "no reachable frontier is left"
    made.members[1].fault = "silent"
    return made


def known():
    costs = np.full((400, 200), 0, np.uint8)
    costs[:, 0], costs[0] = 254, 255
    return Costmap(costs, 0.05, np.array([-5.0, -10.0]), "world")


def told(name="", world=""):
    report = TeamReport(name, world)
    report.begin(10.0, np.array([0.0, 8.0]))
    report.begin(12.0, np.array([1.0, 8.0]))
    report.explored(70.0)
    report.explored(80.0)
    report.tell(90.0, crew(), known())
    assert report.told
    return report


def test_times_paths_and_robots_that_took_no_part_are_told(said):
    told()
    assert said == ["exploration ended after 60 s, the drive back after 80 s: no reachable frontier is left; robot2 "
                    "took no part: silent", "paths: robot1 3.0 m, robot2 4.2 m; 7.2 m together"]


def test_the_map_is_saved_and_the_share_is_told(said, tmp_path):
    told(str(tmp_path / "plan"), "world01")
    plan = read_map(str(tmp_path / "plan.yaml"))
    assert plan.data.shape == (400, 200) and plan.data[5, 0] == 100 and plan.data[0, 5] == -1 and plan.data[5, 5] == 0
    assert any("m^2 that the robots can reach were seen" in text for text in said)
    share = float(next(text for text in said if "were seen" in text).split(" %")[0])
    assert 40.0 < share < 80.0              # half of the world is in this map
    assert any(text.startswith("wrote ") and text.endswith("plan.pgm") for text in said)


def test_a_world_or_a_folder_that_is_not_there_is_told(said, tmp_path):
    told(str(tmp_path / "no" / "plan"), "no_such_world")
    assert any("the share that was seen is not known" in text for text in said)
    assert any("no" in text and "plan" in text for text in said[-2:])


def test_a_map_in_another_frame_is_placed_on_the_world(said):
    world, pose = whole_map(read_world("world02")), np.array([1.0, -7.0, 0.5])       # of the world in the map
    report = TeamReport("", "world02", in_world=False)
    report.begin(0.0, placed(np.array([0.0, 8.0]), pose))
    report.tell(1.0, crew(), merge([world], [pose]))
    assert any(text.startswith(("100.0 %", "99.9 %")) and text.endswith("were seen") for text in said), said


def test_a_map_that_does_not_fit_the_world_has_no_share(said):
    report = TeamReport("", "world02", in_world=False)
    report.begin(0.0, np.array([0.0, 0.0]))
    report.tell(1.0, crew(), known())
    assert any("share that was seen is not known: where the map lies in the world is not certain" in text
               for text in said)
