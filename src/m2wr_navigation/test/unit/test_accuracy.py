# SPDX-License-Identifier: BSD-3-Clause
"""Small forms of what ``accuracy`` measures."""
import json
import os
from types import SimpleNamespace

import numpy as np
import pytest

from m2wr_maps.se2 import compose
from m2wr_navigation.accuracy import command, scenes
from m2wr_navigation.accuracy.driven import driven
from m2wr_navigation.accuracy.navigator import Navigator
from m2wr_navigation.accuracy.rounds import Rounds
from m2wr_navigation.accuracy.runs import NoisyOdometry, random_goals
from m2wr_navigation.accuracy.searches import search
from m2wr_navigation.barn.runs import move_base_parameters
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.methods.body import RobotBody
from m2wr_navigation.methods.method import Sensing

JACKAL = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "robots", "jackal_like.urdf")
CONFIG = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "config", "m2wr.yaml")


@pytest.mark.parametrize("name", scenes.NAMES)
def test_goals_are_inside_of_the_world(name):
    place = scenes.scene(name)
    assert {-1, 0, 100} == set(np.unique(place.cells))
    assert place.cells[0, 0] == -1 and place.cells[-1, -1] == -1
    goals = random_goals(place, 200, 3)
    cells = np.floor((goals[:, :2] - place.origin) / place.map.resolution).astype(int)
    assert (place.cells[cells[:, 1], cells[:, 0]] == 0).all()


def test_the_map_is_not_shifted_against_the_world():
    place, half = scenes.scene("house"), scenes.HALF_OF_A_WALL
    rows, columns = np.nonzero(place.cells == 100)
    centres = (np.stack([columns, rows], -1) + 0.5) * place.map.resolution + place.origin
    assert centres.min(axis=0) == pytest.approx([-7.0 - half, -5.0 - half], abs=0.001)
    assert centres.max(axis=0) == pytest.approx([7.0 + half, 5.0 + half], abs=0.012)    # not whole cells away


def test_goals_are_in_the_largest_part_that_is_connected():
    cells = np.zeros((60, 100), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[:, 30] = 100                          # a small room on the left
    cells[28:32, 30] = 0                        # its door of 20 cm
    for passage, left in ((0.15, False), (0.05, True)):
        places = scenes.free_places(cells, np.zeros(2), 0.3, passage)
        assert (places[:, 0] > 1.5).any() and (places[:, 0] < 1.5).any() == left
        assert places.min() > 0.3


def test_free_places_are_computed_once(monkeypatch):
    place, calls = scenes.scene("pillars"), []
    original = scenes.free_places
    monkeypatch.setattr(scenes, "free_places", lambda *given: calls.append(given) or original(*given))
    for seed in range(3):
        random_goals(place, 1, seed)
    random_goals(place, 1, 0, driven(JACKAL))
    assert len(calls) == 2 and place.map is place.map


def test_the_recovery_behaviours_are_those_of_move_base():
    found = Navigator(None, move_base_parameters(), np.zeros(3))
    names = [each.name for each in found.supervisor.recoveries]
    assert names == ["conservative_reset", "rotate_recovery", "back_up", "aggressive_reset", "rotate_recovery"]
    reset = found.supervisor.recoveries[3].values["reset_distance"]
    assert reset == pytest.approx(4.0 * found.maps["local"].circumscribed)


def test_a_robot_is_read_from_its_description():
    robot = driven(JACKAL)
    assert robot.room == pytest.approx(robot.body.turning_radius + 0.25)
    assert 0.1 < robot.height < 0.5
    assert np.allclose(robot.parameters({"footprint": [], "x": 1})["footprint"], robot.body.hull)
    assert driven("m2wr").room == pytest.approx(0.7)


def test_odometry_drifts_with_the_way():
    ends = []
    for seed in range(40):
        odometry = NoisyOdometry(np.random.default_rng(seed))
        for x in np.arange(0.0, 10.01, 0.05):
            pose = odometry.add(np.array([x, 0.0, 0.0]))
        ends.append(pose)
    mean, spread = np.mean(ends, axis=0), np.std(ends, axis=0)
    assert mean[0] == pytest.approx(10.2, abs=0.1) and mean[2] == pytest.approx(0.1, abs=0.03)
    assert 0.02 < spread[2] < 0.06


def test_the_command_reaches_goals_and_writes_the_figures(tmp_path, capsys):
    out = tmp_path / "figures.json"
    assert command.main(["--worlds", "pillars", "--goals", "4", "--searches", "0", "--config", CONFIG, "--json",
                         str(out)]) == 0
    figures, = json.loads(out.read_text())
    assert (figures["reached"], figures["contacts"], figures["failed"]) == (4, 0, [])
    assert figures["distance_m"]["95"] < 0.1 and figures["angle_deg"]["95"] < 2.0
    assert "pillars       4 of 4" in capsys.readouterr().out


def test_a_robot_that_may_be_anywhere_is_found():
    found = search(scenes.scene("house"), 3, {}, 40.0)
    assert found.found and found.claimed and not found.contacts


def circle(pose, middle, radius, count=180):
    """Ranges of a laser of 360 degrees on the robot's pose to a pillar."""
    angles = pose[2] - np.pi + 2.0 * np.pi / count * np.arange(count)
    across = (middle[0] - pose[0]) * np.sin(angles) - (middle[1] - pose[1]) * np.cos(angles)
    along = (middle[0] - pose[0]) * np.cos(angles) + (middle[1] - pose[1]) * np.sin(angles)
    with np.errstate(invalid="ignore"):
        found = along - np.sqrt(radius ** 2 - across ** 2)
    return np.where(found > 0.0, found, np.inf)


def rounds(pillars, cycles, reach=4.0):
    """Poses (cycles, 3) of a drive from the origin, and the distances (cycles, pillars) from the pillars."""
    poses, away = [np.zeros(3)], []
    drive = Rounds({name: parameter.default for name, parameter in Rounds.PARAMETERS.items()},
                   RobotBody(driven(JACKAL).body.footprint, 0.0, (0.0, 0.0, 0.0)))
    velocity = (0.0, 0.0)
    for k in range(cycles):
        ranges = np.min([circle(poses[-1], middle, radius) for middle, radius in pillars], axis=0)
        decision = drive.step(Sensing(0.1 * k, tuple(poses[-1]), velocity, np.where(ranges < reach, ranges, np.inf),
                                      -np.pi, 2.0 * np.pi / 180))
        velocity = (decision.linear, decision.angular)
        poses.append(compose(poses[-1], np.array([0.1 * velocity[0], 0.0, 0.1 * velocity[1]])))
        away.append([np.hypot(*(poses[-1][:2] - middle)) - radius for middle, radius in pillars])
    return np.array(poses), np.array(away)


def test_rounds_go_round_a_pillar_and_on_to_the_next_one():
    _, away = rounds([((1.5, 0.0), 0.3), ((1.5, 3.5), 0.3)], 900)
    assert away.min() > driven(JACKAL).body.turning_radius      # no contact
    assert (away[:, 0] < 1.0).any() and (away[600:, 1] < 1.0).any()


def test_rounds_spiral_until_something_is_in_sight():
    for yaw in (0.0, 2.0, 4.0):
        middle = 5.0 * np.array([np.cos(yaw), np.sin(yaw)])
        poses, away = rounds([(middle, 0.3)], 900, reach=2.5)
        assert driven(JACKAL).body.turning_radius < away.min() < 1.0
        assert np.hypot(*poses[:, :2].T).max() < 15.0


def test_what_cannot_be_used_is_told_before_the_first_drive(tmp_path, capsys):
    for arguments, words in ((["--worlds", "nowhere"], "there is no such file"),
                             (["--json", str(tmp_path / "no" / "x")], "there is no such folder"),
                             (["--config", os.devnull], "expected a mapping with footprint"),
                             (["--config", str(tmp_path / "none")], "No such file"),
                             (["--robot", str(tmp_path / "none.urdf")], "none.urdf"),
                             (["--worlds", "%s" % _cell(tmp_path)], "has no place with 0.70 m")):
        assert command.main(arguments) == 1
        assert words in capsys.readouterr().err


def _cell(folder):
    """World with a free square of 1 m between four walls."""
    walls = [(-0.58, -0.58, 0.58, -0.58), (-0.58, 0.58, 0.58, 0.58), (-0.58, -0.58, -0.58, 0.58),
             (0.58, -0.58, 0.58, 0.58)]
    path = folder / "cell.world"
    path.write_text(scenes._WORLD % "".join(scenes._box(number, wall) for number, wall in enumerate(walls)))
    return path


def test_another_robot_reaches_goals(capsys):
    assert command.main(["--worlds", "pillars", "--goals", "2", "--searches", "0", "--config", CONFIG, "--robot",
                         JACKAL]) == 0
    assert "pillars       2 of 2" in capsys.readouterr().out


def test_old_names_of_a_controllers_parameters_count():
    given = move_base_parameters()
    values = Navigator(None, given, np.zeros(3)).supervisor.controller.values
    assert (values["path_distance_bias"], values["goal_distance_bias"]) == (0.75, 1.0)      # pdist_scale, gdist_scale


def test_other_robots_are_obstacles_for_the_controller():
    found = Navigator(None, move_base_parameters(), np.zeros(3))
    seen = []
    found.supervisor.cycle = lambda now, situation, late: seen.append(situation.costmap) or SimpleNamespace(messages=())
    found.maps["local"].update(np.zeros(3), 0.0)
    for others in ((), (np.array([(0.8, -0.2), (1.2, -0.2), (1.2, 0.2), (0.8, 0.2)]),), ()):
        found.others = others
        found.cycle(0.0, np.zeros(3))
    assert [grid.cost_at(1.0, 0.0) == LETHAL for grid in seen] == [False, True, False]
