# SPDX-License-Identifier: BSD-3-Clause
"""Five runs of the report's experiment: each is at least as good as the one before, the last is nearly the optimum."""
import numpy as np
import pytest

from m2wr_navigation.best_path.memory import load
from m2wr_navigation.best_path.settings import make_settings
from m2wr_navigation.optimum.shortest_path import shortest_path
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_tools.best_path_runner import run_once
from m2wr_view.outlines import least_clearance
from motion_plan.body import AXLE_X, TURNING_RADIUS
from motion_plan.surroundings import axle_of

START, GOAL = (0.0, 8.0, 0.0), (0.0, -4.0)
SETTINGS = make_settings({}, "~")[0]
CELL = 0.05             # m: clearances are measured on a map of such cells
REPEATED = 0.5 * CELL * 3.0         # m: what half a cell of clearance costs, with the default weight


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Five runs, each with a memory that was saved and loaded, and another noise of the sensors."""
    folder, results = str(tmp_path_factory.mktemp("runs") / "memory"), []
    for seed in range(5):
        memory = load(folder)
        results.append(run_once("world02", memory, START, GOAL, SETTINGS, seed))
        memory.save_map()
        memory.save_runs()
    return results


def test_all_runs_reach_the_goal_without_contacts(runs):
    assert [(result.run.outcome, result.contacts) for result in runs] == [("reached", 0)] * 5
    assert runs[0].run.how == "Bug 2" and all(result.run.how != "Bug 2" for result in runs[1:])


def test_each_run_is_at_least_as_good_as_the_one_before(runs):
    for before, after in zip(runs, runs[1:]):
        assert after.run.total <= before.run.total + REPEATED
        assert after.run.amounts["length"] <= before.run.amounts["length"] + 0.01
        assert after.known_area >= before.known_area
    assert runs[-1].run.total < 0.6 * runs[0].run.total


@pytest.mark.parametrize("radius, ratio", [(TURNING_RADIUS, 1.02), (0.2, 1.05)])
def test_the_last_run_is_near_the_exact_optimum(runs, radius, ratio):
    # of the disc that can turn everywhere, and of the greatest disc inside of the robot, which no robot can beat
    best = shortest_path(obstacle_outlines(read_world("world02")), radius, axle_of(START), GOAL).length
    length = runs[-1].run.amounts["length"]
    assert best - 0.1 <= length <= ratio * best


def test_the_score_predicted_is_the_score_driven(runs):
    for result in runs[1:]:
        assert result.candidates[0].total == pytest.approx(result.run.total, rel=0.02)
        assert result.run.how in [candidate.name for candidate in result.candidates]


def test_the_clearance_is_true(runs):
    obstacles = obstacle_outlines(read_world("world02"))
    for result in runs:
        poses = result.run.track.poses.copy()
        poses[:, :2] -= AXLE_X * np.stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])], -1)      # of link_chassis
        assert least_clearance(poses, obstacles).distance == pytest.approx(result.run.amounts["clearance"], abs=0.06)
