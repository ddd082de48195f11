# SPDX-License-Identifier: BSD-3-Clause
"""Methods without a map drive the simulated robot to goals, end where theory says, and never hit anything."""
import functools
import math
from dataclasses import replace

import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.compare.drive import drive_method, final_distance
from m2wr_navigation.compare.scenes import generated
from m2wr_navigation.methods.body import M2WR
from m2wr_navigation.methods.method import RADIUS_MARGIN, REACHED, RUNNING, STUCK, UNREACHABLE, Sensing
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_navigation.parameters import read
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines

BUGS = ("bug0", "bug1", "bug2", "dist_bug", "tangent_bug")
SCENES = {"world02": ((0.0, 8.0, 0.0), (0.0, -4.0)), "world03": ((0.0, 8.0, 0.0), (-7.0, -4.0)),
          "unreachable": ((0.0, 8.0, 0.0), (0.0, -4.0))}


def method(name, **given):
    kind = registry.find(registry.METHODS, name)
    values, warnings = read(kind.PARAMETERS, given, "~" + name)
    assert not warnings and set(given) <= set(kind.PARAMETERS)
    return kind(values)


@functools.lru_cache(maxsize=None)
def driven(world, name, **given):
    start, goal = SCENES[world]
    return drive_method(read_world(world), start, goal, method(name, **given), 300.0)


def sensing(ranges, pose=(0.0, 0.0, 0.0), stamp=0.0):
    return Sensing(stamp, pose, (0.0, 0.0), np.asarray(ranges, np.float32), -0.5 * math.pi, math.pi / 100.0)


#: Greatest length over the shortest path of the disc that is kept free.
RATIOS = {("world02", "bug0"): 1.3, ("world02", "bug1"): 5.5, ("world02", "bug2"): 2.0, ("world02", "dist_bug"): 1.3,
          ("world02", "tangent_bug"): 2.1, ("world02", "vfh_plus"): 2.0, ("world02", "follow_the_gap"): 2.0,
          ("world03", "bug2"): 4.7, ("world03", "dist_bug"): 4.2,
          ("world03", "tangent_bug"): 1.1, ("world03", "vfh_plus"): 1.15, ("world03", "follow_the_gap"): 1.15,
          ("world03", "potential_field"): 1.15, ("world03", "dwa"): 1.15,
          ("world02", "mppi"): 1.15,
          ("world02", "learned"): 2.0, ("world03", "learned"): 1.15}


@pytest.mark.parametrize("world, name", sorted(RATIOS))
def test_a_method_reaches_its_goal_without_a_contact(world, name):
    start, goal = SCENES[world]
    run = driven(world, name)
    assert run.outcome == REACHED and run.contacts == 0, run.reason
    assert final_distance(run.poses, goal) < 0.3
    best = shortest_path(obstacle_outlines(read_world(world)), 0.2, start, goal).length
    assert best - 0.3 < run.length < RATIOS[world, name] * best


@pytest.mark.parametrize("name", BUGS)
def test_a_goal_that_is_walled_in_is_told_after_one_circuit(name):
    run = driven("unreachable", name)
    assert run.outcome == UNREACHABLE and run.contacts == 0 and run.reason.startswith("went round the obstacle")
    assert run.length < 40.0


def test_bug_0_notices_that_it_repeats():
    run = driven("world03", "bug0")
    assert run.outcome == UNREACHABLE and "3 times" in run.reason and run.contacts == 0


def test_a_potential_field_is_stuck_in_a_local_minimum():
    run = driven("world02", "potential_field", patience=20.0)
    assert run.outcome == STUCK and run.contacts == 0 and "moved less than 1 m" in run.reason


@pytest.mark.parametrize("name", sorted(registry.METHODS))
def test_without_obstacles_a_method_drives_towards_its_goal(name):
    made = method(name)
    made.begin((5.0, 0.0))
    velocity = (0.0, 0.0)
    for cycle in range(40):         # MPPI improves its commands from cycle to cycle, DWA accelerates
        decision = made.step(replace(sensing(np.full(101, np.inf), stamp=0.05 * cycle), velocity=velocity))
        velocity = decision.linear, decision.angular
    assert decision.outcome == RUNNING and decision.linear > 0.3 and abs(decision.angular) < 0.3


@pytest.mark.parametrize("name", sorted(registry.METHODS))
def test_at_the_goal_a_method_stops_and_stays_so(name):
    made = method(name)
    made.begin((-0.05, 0.1))
    decision = made.step(sensing(np.full(101, np.inf)))
    assert (decision.outcome, decision.linear, decision.angular) == (REACHED, 0.0, 0.0)
    assert made.step(sensing(np.full(101, np.inf), (9.0, 9.0, 0.0))) == decision
    made.begin((5.0, 0.0))
    assert made.step(sensing(np.full(101, np.inf))).outcome == RUNNING


@pytest.mark.parametrize("name", sorted(registry.METHODS))
@pytest.mark.parametrize("ranges, pose", [
    ([], (0.0, 0.0, 0.0)), (np.full(101, np.nan), (0.0, 0.0, 0.0)), (np.full(101, 3.0), (math.nan, 0.0, 0.0)),
    (np.full(101, -np.inf), (0.0, 0.0, 0.0)), (np.full(101, 0.0), (0.0, 0.0, 0.0))])
def test_odd_readings_do_not_raise(name, ranges, pose):
    made = method(name)
    made.begin((5.0, 0.0))
    made.step(sensing(np.full(101, 2.0)))
    decision = made.step(sensing(ranges, pose))
    assert math.isfinite(decision.linear) and math.isfinite(decision.angular)
    if len(ranges) == 0 or math.isnan(pose[0]):
        assert decision.linear == decision.angular == 0.0 and "expected" in decision.reason


@pytest.mark.parametrize("name", sorted(registry.METHODS))
def test_a_goal_that_is_not_finite_is_refused(name):
    with pytest.raises(ValueError, match="expected finite numbers"):
        method(name).begin((math.nan, 0.0))


@pytest.mark.parametrize("name", sorted(registry.METHODS))
def test_a_drive_is_the_same_again(name):
    made = method(name)
    answers = []
    for _ in range(2):
        made.begin((5.0, 1.0))
        rng = np.random.default_rng(1)
        answers.append([made.step(sensing(rng.uniform(0.7, 4.0, 101), stamp=0.05 * k)) for k in range(5)])
    assert answers[0] == answers[1]


@pytest.mark.parametrize("number", range(4))
def test_tangent_bug_gets_out_of_rooms(number):
    # it had left a boundary for places that it could not reach, and come back to it
    scene = list(generated(number + 1, 7, M2WR.turning_radius + RADIUS_MARGIN))[number]
    run = drive_method(read_world(scene.world), scene.start, scene.goal, method("tangent_bug"), 300.0)
    assert run.outcome == REACHED and run.contacts == 0, run.reason
