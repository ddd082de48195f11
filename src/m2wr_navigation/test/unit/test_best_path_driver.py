# SPDX-License-Identifier: BSD-3-Clause
"""Drives in worlds of cells: hopes, dead ends, and the rule that no run is worse than the best one before."""
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from m2wr_navigation.best_path.driver import BestPath
from m2wr_navigation.best_path.memory import Run
from m2wr_navigation.best_path.settings import make_settings
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import ObstacleField, Track
from m2wr_navigation.methods.method import RUNNING
from motion_plan.body import AXLE_X, LASER_X

SIDE, CELL, PERIOD = 12.0, 0.05, 0.1
RANGE = 2.5                 # m: the laser is short-sighted, so that hopes are hopes
GOAL = np.array([10.5, 6.0])
#: A wall with a short cut in the middle and a way round at the upper end; the short cut may end in a dead end.
WALL = [(5.0, 0.0, 5.3, 5.2), (5.0, 6.8, 5.3, 10.0)]
DEAD_END = [(5.0, 5.0, 8.3, 5.2), (5.0, 6.8, 8.3, 7.0), (8.0, 5.0, 8.3, 7.0)]


def world(*boxes):
    cells = np.zeros((int(SIDE / CELL),) * 2, bool)
    for x0, y0, x1, y1 in boxes + ((0, 0, SIDE, 0.1), (0, SIDE - 0.1, SIDE, SIDE), (0, 0, 0.1, SIDE),
                                   (SIDE - 0.1, 0, SIDE, SIDE)):
        cells[int(y0 / CELL):int(y1 / CELL), int(x0 / CELL):int(x1 / CELL)] = True
    return cells


class Robot:
    """Follows commands at once, sees the true cells with a laser of 180 degrees."""

    def __init__(self, cells, settings, survey, record=None):
        self.cells, self.survey, self.settings = cells, survey, settings
        self.axle, self.now, self.velocity = np.array([1.5, 6.0, 0.0]), 0.0, np.zeros(3)
        self.driver = BestPath(settings, survey, GOAL, record)
        self.names = []

    def look(self):
        x, y, yaw = self.axle
        chassis = np.array([x - AXLE_X * math.cos(yaw), y - AXLE_X * math.sin(yaw)])
        laser = chassis + LASER_X * np.array([math.cos(yaw), math.sin(yaw)])
        angles = yaw + np.linspace(-0.5 * math.pi, 0.5 * math.pi, 180)
        steps = np.arange(0.03, RANGE, 0.03)
        points = laser + steps[:, None, None] * np.stack([np.cos(angles), np.sin(angles)], -1)
        at = np.clip((points / CELL).astype(int), 0, len(self.cells) - 1)
        hit = self.cells[at[..., 1], at[..., 0]]
        ranges = np.where(hit.any(0), steps[hit.argmax(0)], np.inf)
        self.survey.add(self.now, (chassis[0], chassis[1], yaw), SimpleNamespace(
            ranges=ranges, angle_min=-0.5 * math.pi, angle_increment=math.pi / 179, range_min=0.0, range_max=RANGE))

    def drive(self, limit=300.0):
        decision = None
        while self.now < limit:
            self.look()
            decision = self.driver.step(self.now, self.axle, self.velocity)
            if decision.outcome != RUNNING:
                break
            if self.driver.chosen and self.driver.chosen.name not in self.names[-1:]:
                self.names.append(self.driver.chosen.name)
            self.velocity = np.array([decision.linear, 0.0, decision.angular])
            self.axle = self.axle + PERIOD * np.array([
                decision.linear * math.cos(self.axle[2]), decision.linear * math.sin(self.axle[2]), decision.angular])
            self.now += PERIOD
        track = self.driver.track
        score = self.settings.scorer.score(track, ObstacleField(self.survey.costs)) if track else None
        return decision, track, score


SETTINGS = make_settings({"planners": ["ThetaStar"]}, "~")[0]


def survey_of(cells, unknown=()):
    """Return a survey that knows everything but some boxes."""
    survey = Survey(SIDE, (0.5 * SIDE, 0.5 * SIDE))
    known = np.where(cells, 100, 0).astype(np.int8)
    for x0, y0, x1, y1 in unknown:
        known[int(y0 / CELL):int(y1 / CELL), int(x0 / CELL):int(x1 / CELL)] = -1
    survey.seed(known, CELL, (0.0, 0.0))
    return survey


CUT = (5.0, 5.2, 8.5, 6.8)             # the short cut, which no run has seen
WAY_ROUND = world(*WALL, CUT)


def record_of(worse_by):
    """Return the best run so far, round the wall, made worse by some metres."""
    found = Robot(WAY_ROUND, SETTINGS, survey_of(WAY_ROUND))
    decision, track, score = found.drive()
    assert decision.outcome == "reached"
    return 1, Run("before", "reached", "", track, np.zeros((0, 3)), score.amounts, score.total + worse_by)


def test_without_knowledge_a_dead_end_is_left_again():
    robot = Robot(world(*WALL, *DEAD_END), SETTINGS, Survey(SIDE, (0.5 * SIDE, 0.5 * SIDE)))
    decision, track, _ = robot.drive()
    assert decision.outcome == "reached" and robot.driver.plans > 1 and track.length > 12.0
    assert any("unknown" in name for name in robot.names)


def test_a_hope_that_comes_true_shortens_the_path():
    cells = world(*WALL)
    survey, (number, record) = survey_of(cells, [CUT]), record_of(5.0)
    robot = Robot(cells, SETTINGS, survey, (number, record))
    decision, track, score = robot.drive()
    assert decision.outcome == "reached" and "unknown" in robot.names[0]
    assert track.length < 9.3 < record.track.length and score.total < record.total


@pytest.mark.parametrize("slack", [0.5, 4.0, 8.0, 20.0])
def test_a_hope_that_fails_makes_no_run_worse_than_the_record(slack):
    cells = world(*WALL, *DEAD_END)
    record = record_of(slack)
    robot = Robot(cells, SETTINGS, survey_of(cells, [CUT]), record)
    decision, _, score = robot.drive()
    assert decision.outcome == "reached" and score.total <= record[1].total * 1.005
    # with little to lose nothing is tried; with much the dead end is
    assert any("unknown" in name for name in robot.names) == (slack > 2.0), robot.names


def test_a_walled_in_goal_is_told_after_all_was_tried():
    cells = world((9.0, 4.5, 9.2, 7.5), (9.0, 4.5, SIDE, 4.7), (9.0, 7.3, SIDE, 7.5))
    robot = Robot(cells, SETTINGS, Survey(SIDE, (0.5 * SIDE, 0.5 * SIDE)))
    decision, _, _ = robot.drive()
    assert decision.outcome == "unreachable" and "no way through" in decision.reason


def test_an_obstacle_that_was_not_there_is_driven_round():
    cells = world((5.0, 5.0, 5.3, 7.0))
    robot = Robot(cells, SETTINGS, survey_of(world()))
    decision, track, score = robot.drive()
    assert decision.outcome == "reached" and robot.driver.plans >= 2 and track.length > 9.05
    assert score.amounts["clearance"] > 0.0


@pytest.mark.parametrize("beside", [0.15, 0.2, 0.25, 0.3])
def test_a_box_beside_the_path_is_driven_round(beside):
    cells = world((5.0, 6.0 + beside, 5.4, 6.4 + beside))
    robot = Robot(cells, SETTINGS, survey_of(world()))
    decision, _, score = robot.drive()
    assert decision.outcome == "reached", decision.reason
    assert score.amounts["clearance"] > 0.0


def test_a_record_whose_way_is_closed_hides_no_other_way():
    cells = world(*WALL, (5.0, 10.0, 5.3, SIDE))
    survey = survey_of(WAY_ROUND, [CUT])
    robot = Robot(cells, SETTINGS, survey, record_of(0.0))
    decision, _, _ = robot.drive()
    assert decision.outcome == "reached", decision.reason
    assert any("unknown" in name for name in robot.names)


def test_the_path_of_a_run_is_followed_to_the_goal():
    number, record = record_of(5.0)
    keep = np.hypot(*(record.track.poses[:, :2] - GOAL).T) > 0.45      # as a run by Bug 2, which ends before the goal
    track = Track(record.track.stamps[keep], record.track.poses[keep], GOAL)
    robot = Robot(WAY_ROUND, SETTINGS, survey_of(WAY_ROUND), (number, replace(record, track=track)))
    decision, _, _ = robot.drive()
    assert robot.names == ["run 1 again"] and decision.outcome == "reached"
    assert np.hypot(*(robot.axle[:2] - GOAL)) <= 0.2
