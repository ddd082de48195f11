# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from motion_plan.bug2 import Bug2, ReportRule, State, distance_to_line
from motion_plan.circuit import Circuit
from motion_plan.surroundings import Surroundings

REGIONS = {'right': 10.0, 'fright': 10.0, 'front': 10.0, 'fleft': 10.0, 'left': 10.0}


def surroundings(*points):
    around = Surroundings()
    around.points = np.array(points, dtype=float).reshape(-1, 2)
    return around


def test_distance_to_line_is_the_printed_formula():
    rng = np.random.default_rng(2)
    for x0, y0, x1, y1, x2, y2 in rng.uniform(-9, 9, (100, 6)):
        printed = abs((y2 - y1) * x0 - (x2 - x1) * y0 + x2 * y1 - y2 * x1) / math.sqrt((y2 - y1) ** 2 + (x2 - x1) ** 2)
        assert distance_to_line((x0, y0), (x1, y1), (x2, y2)) == pytest.approx(printed)
    assert distance_to_line((3, 100), (0, 8), (0, -4)) == pytest.approx(3.0)
    assert distance_to_line((1, 0), (0, 0), (1, 1)) == pytest.approx(math.sqrt(0.5))


@pytest.mark.parametrize('start, goal, rule, text', [
    ((1, 1), (1, 1), 'complete', 'same point'), ((0, math.nan), (1, 1), 'complete', 'finite'),
    ((0, 0), (math.inf, 1), 'complete', 'finite'), ((0, 0), (1, 1), 'textbook', 'complete, report')])
def test_bad_parameters_are_named(start, goal, rule, text):
    with pytest.raises(ValueError, match=text):
        Bug2(start, goal, rule)


@pytest.mark.parametrize('front, hit', [(0.15, False), (0.16, True), (0.99, True), (1.0, False), (0.0, False)])
def test_report_rule_hits_between_its_limits(front, hit):
    bug = Bug2((0, 8), (0, -4), 'report')
    state = bug.update(0.0, (0, 5, -1.5), dict(REGIONS, front=front), surroundings())
    assert state is (State.WALL_FOLLOWING if hit else State.GO_TO_POINT)


def test_report_rule_leaves_in_the_sixth_counted_second():
    bug = Bug2((0, 8), (0, -4), 'report')
    bug.update(0.0, (0, 5, 0), dict(REGIONS, front=0.5), surroundings())
    turns = 1
    while bug.state is State.WALL_FOLLOWING:
        bug.update(turns * 0.05, (0.05, 6.5, 0), REGIONS, surroundings())    # farther from the goal: ignored
        turns += 1
    assert turns == 121    # six times twenty turns were counted before
    assert bug.leave_point == (0.05, 6.5)


def test_report_rule_counts_on_off_the_line():
    rule = ReportRule((0, 8), (0, -4))
    for _ in range(200):
        rule.end_turn()
    assert rule.leave(0.0, (0.11, 0, 0), None) is None
    assert rule.leave(0.0, (0.09, 0, 0), None) is not None


def following(hit=(0.0, 2.0)):
    """A complete Bug 2 that has just hit a wall."""
    bug = Bug2((0, 8), (0, -4))
    bug.update(0.0, (hit[0], hit[1], -1.57), REGIONS, surroundings((hit[0], hit[1] - 0.7)), (0.6, 0.0))
    assert bug.state is State.WALL_FOLLOWING and bug.hit_point == hit
    return bug


def test_complete_rule_hits_one_metre_ahead_at_full_speed():
    for gap, state in ((0.98, State.WALL_FOLLOWING), (1.02, State.GO_TO_POINT)):
        bug = Bug2((0, 8), (0, -4))
        # laser at 0.15 ahead of the chassis
        bug.update(0.0, (0, 5, -math.pi / 2), REGIONS, surroundings((0.0, 5 - 0.15 - gap)), (0.6, 0.0))
        assert bug.state is state


def test_complete_rule_sees_what_the_front_sector_does_not():
    bug = Bug2((0, 8), (0, -4))
    bug.update(0.0, (0, 5, -math.pi / 2), dict(REGIONS), surroundings((0.45, 4.6)), (0.6, 0.0))
    assert bug.state is State.WALL_FOLLOWING


def test_an_obstacle_behind_the_goal_is_not_in_the_way():
    bug = Bug2((0, 8), (0, -4))
    assert bug.update(0.0, (0, -3.2, -math.pi / 2), REGIONS, surroundings((0.0, -4.4)), (0.6, 0.0)) is State.GO_TO_POINT


def test_complete_rule_leaves_only_nearer_to_the_goal():
    bug = following()
    wall = surroundings((-0.6, 0.0))
    assert bug.update(1.0, (0.05, 3.0, 0.0), REGIONS, wall) is State.WALL_FOLLOWING
    assert bug.update(2.0, (0.05, 1.9, 0.0), REGIONS, wall) is State.WALL_FOLLOWING
    assert bug.update(3.0, (0.05, 1.7, 0.0), REGIONS, wall) is State.GO_TO_POINT
    assert bug.leave_point == (0.05, 1.7)


def test_complete_rule_leaves_only_on_the_m_line():
    bug = following()
    assert bug.update(1.0, (0.5, 1.0, 0.0), REGIONS, surroundings((1.1, 1.0))) is State.WALL_FOLLOWING
    assert bug.update(2.0, (0.2, 1.0, 0.0), REGIONS, surroundings((1.1, 1.0))) is State.WALL_FOLLOWING
    # across the line between two periods
    assert bug.update(3.0, (-0.2, 1.0, 0.0), REGIONS, surroundings((1.1, 1.0))) is State.GO_TO_POINT


def test_complete_rule_stays_while_the_path_is_blocked():
    bug = following()
    assert bug.update(1.0, (0.0, 1.0, 0.0), REGIONS, surroundings((0.2, 0.2))) is State.WALL_FOLLOWING


def test_goal_is_reached_at_rest_only():
    bug = Bug2((0, 8), (0, -4))
    near = (0.0, -3.75, -1.57)
    assert bug.update(0.0, near, REGIONS, surroundings(), (0.3, 0.0)) is State.GO_TO_POINT
    assert bug.update(0.1, near, REGIONS, surroundings(), (0.0, 0.0)) is State.GO_TO_POINT
    assert bug.update(0.5, near, REGIONS, surroundings(), (0.0, 0.0)) is State.GO_TO_POINT
    assert bug.update(0.7, near, REGIONS, surroundings(), (0.0, 0.0)) is State.GOAL_REACHED
    assert bug.finished


def test_rest_elsewhere_is_not_the_goal():
    bug = Bug2((0, 8), (0, -4))
    for tick in range(100):
        bug.update(tick * 0.1, (0.0, -3.6, -1.57), REGIONS, surroundings(), (0.0, 0.0))
    assert bug.state is State.GO_TO_POINT


def test_robot_that_gets_nowhere_is_unreachable():
    bug = following()
    for tick in range(1000):
        bug.update(tick * 0.05, (0.0, 2.0, tick * 0.02), REGIONS, surroundings((0.0, 1.3), (0.6, 2.0)))
        if bug.finished:
            break
    assert bug.state is State.GOAL_UNREACHABLE and 44.0 < tick * 0.05 < 46.0


def test_restart_forgets():
    bug = following()
    bug.restart()
    assert bug.state is State.GO_TO_POINT and bug.hit_point is None


def circle(circuit, radius, laps, start=0.0):
    """Drive circles; return the laps after which the track counted as closed."""
    for step in range(int(laps * 400)):
        angle = start + step * 2 * math.pi / 400
        if circuit.add((radius * math.cos(angle), radius * math.sin(angle), angle + math.pi / 2)):
            return step / 400
    return None


def test_a_large_circuit_closes_after_one_lap_and_a_metre():
    assert circle(Circuit(), 3.0, 2) == pytest.approx(1.0 + 1.5 / (6 * math.pi), abs=0.05)


def test_a_small_circuit_closes_in_the_second_lap():
    assert 1.5 < circle(Circuit(), 0.7, 3) < 2.3


def test_driving_back_beside_the_track_is_no_circuit():
    circuit = Circuit()
    assert not any(circuit.add((x, 0.0, 0.0)) for x in np.arange(0, 6, 0.05))
    assert not any(circuit.add((6.0, y, math.pi / 2)) for y in np.arange(0, 0.3, 0.05))
    assert not any(circuit.add((x, 0.25, math.pi)) for x in np.arange(6, 0, -0.05))


def test_circuit_knows_whether_it_passes_its_start():
    circuit = Circuit()
    for x in np.arange(-6.0, 3.0, 0.1):
        circuit.add((x, -3.0, 0.0))
    assert circle(circuit, 3.0, 2, -math.pi / 2 + 0.3) is not None
    assert not circuit.passes_start((0.0, 3.0, math.pi))
