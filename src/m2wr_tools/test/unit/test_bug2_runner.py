# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2 in one process: it reaches the goal without contacts, and each run is the same."""
import math

import numpy as np
import pytest

from m2wr_sim.api import Sim, read_robot, read_world
from m2wr_tools.bug2_runner import TURN, Bug2Driver, run_bug2


@pytest.fixture(scope="module")
def robot():
    """Return the robot, read once."""
    return read_robot("m2wr")


@pytest.fixture(scope="module")
def experiment(robot):
    """Return the run of bug2.launch without arguments."""
    return run_bug2(robot=robot)


def test_the_experiment_reaches_its_goal_without_contacts(experiment):
    assert experiment.outcome == "goal_reached" and experiment.contacts == () and experiment.reached
    assert np.hypot(*(experiment.path[-1, 1:3] - experiment.goal)) < 0.31
    # the way is known to take this long; a twentieth of room for another order of roundings
    assert experiment.time == pytest.approx(71.4, rel=0.05)
    assert experiment.path_length == pytest.approx(30.0, rel=0.05)


def test_states_hit_and_leave_points_make_sense(experiment):
    names = [change.state for change in experiment.states]
    assert names == ["go_to_point", "wall_following"] * (len(names) // 2 - 1) + ["go_to_point", "goal_reached"]
    hits, leaves = experiment.points("wall_following"), experiment.points("go_to_point")[1:]
    assert len(hits) == len(leaves) >= 1
    for hit, leave in zip(hits, leaves):
        assert abs(leave[0]) < 0.15                     # the m-line is x = 0
        assert leave[1] < hit[1] - 0.2                  # and the goal lies south
    assert all(change.reason for change in experiment.states[1:])


def test_path_tells_every_turn(experiment):
    times = experiment.path[:, 0]
    assert np.allclose(np.diff(times), TURN) and times[-1] == experiment.time
    moved = np.hypot(np.diff(experiment.path[:, 1]), np.diff(experiment.path[:, 2]))
    assert moved.max() < 0.8 * TURN                     # 0.6 m/s and the nodding of the body


@pytest.mark.parametrize("world, seed, phase", [
    ("world02", 1, 0.0), ("world02", 2, 0.013), ("world02", 3, 0.049), ("world03", 0, 0.0), ("world03", 4, 0.031)])
def test_every_seed_and_phase_reaches_the_goal(robot, world, seed, phase):
    run = run_bug2(world, seed=seed, phase=phase, robot=robot)
    assert run.reached, (run, run.contacts)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_printed_rule_arrives_despite_contacts(robot, seed):
    run = run_bug2("world02", seed=seed, leave_rule="report", robot=robot, limit=150.0)
    assert run.outcome == "goal_reached" and run.contacts, run


def test_a_yard_without_a_gate_is_found_to_be_closed(robot):
    run = run_bug2("unreachable", robot=robot)
    assert run.outcome == "goal_unreachable" and run.contacts == () and not run.reached
    assert "went round the obstacle" in run.reason
    with Sim("unreachable", robot, (0.0, 8.0, 0.0)) as sim:
        driver = Bug2Driver(sim, "m2wr", (0.0, 8.0), (0.0, -4.0))
        while not driver.turn():
            sim.step(None, TURN)
        assert sim.step(None, 1.0).odometry.linear_x == pytest.approx(0.0, abs=1e-3)    # and the robot rests


def test_one_seed_drives_the_same_way_to_the_last_bit(robot, experiment):
    again = run_bug2(robot=robot)
    assert again.path.tobytes() == experiment.path.tobytes() and again.states == experiment.states
    other = run_bug2(robot=robot, seed=1)
    assert other.path.tobytes() != experiment.path.tobytes()


def test_the_printed_rule_drives_without_the_guard(robot):
    run = run_bug2("world01", leave_rule="report", robot=robot)
    assert run.outcome == "goal_reached" and [change.state for change in run.states] == ["go_to_point", "goal_reached"]


def test_time_out_is_an_outcome(robot):
    run = run_bug2(robot=robot, limit=2.0)
    assert run.outcome == "time_out" and run.time == pytest.approx(2.0, abs=TURN) and "not over" in run.reason


def test_the_pose_at_the_scan_is_that_of_its_time(robot):
    with Sim(read_world("world02"), robot, (0.0, 8.0, -1.5)) as sim:
        driver = Bug2Driver(sim, "m2wr", (0.0, 8.0), (0.0, -4.0))
        for _ in range(120):
            sim.step(None, TURN)
            driver.turn()
        seen = driver._surroundings.points
        assert len(seen) > 50
        # the barriers across the way: their northern faces at the laser's height, 0.34 m before their centres at 4.73
        x, y, _ = sim.observe().pose
        near = seen[np.abs(seen[:, 0] - x) < 0.3]
        assert near[:, 1].max() == pytest.approx(4.73 + 0.336, abs=0.06)
        driver.close()
        assert sim.drive().callbacks == [] and sim.lasers()[0].callbacks == []


@pytest.mark.parametrize("options, text", [
    ({"start": (0.0, math.nan)}, "finite"), ({"goal": (0.0, 8.0)}, "same point"),
    ({"leave_rule": "never"}, "leave_rule"), ({"phase": 0.05}, "phase"),
    ({"sensing": "off"}, "no laser that measures by itself")])
def test_unusable_values_are_refused(robot, options, text):
    with pytest.raises(ValueError, match=text):
        run_bug2("empty", robot=robot, **options)
