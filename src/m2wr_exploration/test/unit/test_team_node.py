# SPDX-License-Identifier: BSD-3-Clause
"""The node explore_team, without a master: what it refuses at the start, who drives, and who does not."""
from types import SimpleNamespace

import numpy as np
import pytest
import rospy

from m2wr_exploration.crew import Crew
from m2wr_exploration.ros.team_node import TeamError, TeamNode, too_fast
from m2wr_exploration.team.placing import Placing
from m2wr_exploration.team.trails import Trails

POSES = {"init_pose_x": 0.0, "init_pose_y": 0.0, "init_pose_yaw": 0.0}
SQUARE = [[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]]


@pytest.mark.parametrize("given, words", [
    ({"~": {"robots": 9}}, "parameter ~robots is 9; expected a whole number from 1 to 8"),
    ({"~": {"robots": 0}}, "parameter ~robots is 0"),
    ({"/robot2/map_merge": {"init_pose_x": "north"}}, "/robot2/map_merge/init_pose_x is 'north'; expected a number"),
    ({"/robot1/move_base/footprint": [[0.0, 0.0]]}, "")])
def test_what_cannot_be_used_is_refused_with_a_reason(monkeypatch, given, words):
    parameters = dict({"~": {}, "/robot1/map_merge": POSES, "/robot2/map_merge": POSES,
                       "/robot1/move_base/footprint": SQUARE}, **given)
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: parameters.get(name, default))
    monkeypatch.setattr(rospy, "get_name", lambda: "/explore_team")
    monkeypatch.setattr(rospy, "logwarn", lambda *args: None)
    with pytest.raises(TeamError) as error:
        TeamNode()
    assert words in str(error.value) and str(error.value)


@pytest.mark.parametrize("robots, factor, cores, words", [
    (4, 1.0, 2, ""), (8, 0.4, 2, ""), (8, -1.0, 2, ""), (8, 1.0, 8, ""),
    (8, 1.0, 2, "8 robots need about 4.3 processor cores at real time, and there are 2: with real_time_factor 1 "
                "their maps may be wrong; use real_time_factor:=0.4"),
    (2, 0.0, 2, "with real_time_factor 0 their maps may be wrong; use real_time_factor:=2.3")])
def test_a_machine_that_is_too_slow_is_named(robots, factor, cores, words):
    assert too_fast(robots, factor, cores).endswith(words) and bool(too_fast(robots, factor, cores)) == bool(words)


class Robot:
    """Stands for a robot: its pose, the command that it wants, and what it gets."""

    def __init__(self, x, command, pose=True):
        self.pose, self.velocity = np.array([x, 0.0, 0.0]) if pose else None, np.zeros(2)
        self.asked, self.got, self.shown = command, None, None

    def locate(self):
        pass

    def pose_at(self, stamp):
        return None if self.pose is None else self.pose - np.array([stamp.to_sec(), 0.0, 0.0])

    def pass_scans(self):
        pass

    def wanted(self, now):
        return self.asked

    def command(self, velocity):
        self.got = velocity

    def show_teammates(self, outlines):
        self.shown = len(outlines)


def drive(monkeypatch, *robots, lost=(), placing=None):
    monkeypatch.setattr(rospy, "get_time", lambda: 1.0)
    names = ["robot%d" % (number + 1) for number in range(len(robots))]
    node = SimpleNamespace(robots=robots, crew=Crew(names, [SimpleNamespace(target=None) for _ in names], placing),
                           _ticks=3, _outline=np.array(SQUARE), _trails=Trails(len(names), np.array(SQUARE)))
    for number in lost:
        node.crew.members[number].fault = "silent"
    TeamNode._drive(node)
    for number, robot in enumerate(robots):
        robot.places = [place.tolist() for place in TeamNode._places(node, number, rospy.Time(1))]
    return robots


def test_robots_that_are_apart_take_the_commands_they_want(monkeypatch):
    first, second = drive(monkeypatch, Robot(0.0, (0.5, 0.0)), Robot(5.0, (0.3, 0.1)))
    assert (first.got, second.got) == ((0.5, 0.0), (0.3, 0.1)) and (first.shown, second.shown) == (1, 1)
    assert (first.places, second.places) == ([[4.0, 0.0]], [[-1.0, 0.0]])      # at the time that was asked for


def test_a_robot_stops_before_its_teammate(monkeypatch):
    first, _ = drive(monkeypatch, Robot(0.0, (0.5, 0.0)), Robot(0.51, (0.0, 0.0)))
    assert first.got == (0.0, 0.0)


def test_a_lost_robot_stops_and_one_without_pose_gets_nothing(monkeypatch):
    lost, there, missing = drive(monkeypatch, Robot(0.0, (0.5, 0.0)), Robot(5.0, (0.5, 0.0)),
                                 Robot(9.0, (0.5, 0.0), pose=False), lost=(0,))
    assert (lost.got, there.got, missing.got) == ((0.0, 0.0), (0.5, 0.0), None) and there.shown == 1
    assert lost.places == [[4.0, 0.0]]


def test_robots_that_do_not_know_of_each_other_drive_alone(monkeypatch):
    placing = Placing(["robot1", "robot2"])
    first, second = drive(monkeypatch, Robot(0.0, (0.5, 0.0)), Robot(0.51, (0.0, 0.0)), placing=placing)
    assert first.got == (0.5, 0.0) and first.places == [] and (first.shown, second.shown) == (0, 0)


def test_a_robot_stops_before_one_whose_map_has_been_placed(monkeypatch):
    placing = Placing(["robot1", "robot2"])
    placing.join(0, 1, np.array([0.51, 0.0, np.pi / 2.0]))
    first, second = drive(monkeypatch, Robot(0.0, (0.5, 0.0)), Robot(0.0, (0.0, 0.0)), placing=placing)
    assert first.got == (0.0, 0.0) and first.places[0] == pytest.approx([0.51, -1.0])
    assert second.places[0] == pytest.approx([0.0, 1.51])       # to the left of robot2, in its own map
