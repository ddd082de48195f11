# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from localization_room import room, scan, settings
from m2wr_maps.se2 import between, compose
from m2wr_navigation.localization.confidence import doubt
from m2wr_navigation.localization.localizer import Localizer

START = np.array([0.7, 2.0, 0.0])
ODOM = np.array([-3.0, 1.0, 2.0])       # of the map's origin in the odometry's frame
STEP = np.array([0.12, 0.0, 0.05])


def localizer(**values):
    found = Localizer(room(), settings(**values), np.random.default_rng(2))
    found.start_at(START + [0.1, -0.1, 0.05], np.diag([0.02, 0.02, 0.01]))
    return found


def drive(found, steps=25, laser="laser", start=START, drift=0.02):
    """Drive on; odometry measures each step a little too long. Returns errors (steps, 3) and outcomes."""
    pose, odom = start, compose(ODOM, start)
    errors, outcomes = [], []
    for _ in range(steps):
        outcomes.append(found.process(laser, scan(pose), odom))
        if outcomes[-1].map_from_odom is not None:
            errors.append(between(pose, compose(outcomes[-1].map_from_odom, odom)))
        pose, odom = compose(pose, STEP), compose(odom, STEP * (1.0 + drift))
    return np.array(errors), outcomes


def test_the_error_stays_below_a_cell():
    errors, _ = drive(localizer())
    assert len(errors) == 25
    assert np.hypot(*errors[5:, :2].T).max() < 0.05 and np.abs(errors[5:, 2]).max() < np.radians(2.0)


def test_without_scan_matching_the_filter_alone_follows():
    errors, _ = drive(localizer(scan_matching=False))
    assert np.hypot(*errors[5:, :2].T).max() < 0.15


def test_a_pose_is_due_at_the_start_and_after_each_second_update():
    _, outcomes = drive(localizer(update_min_d=0.1, update_min_a=0.3), steps=9)
    updates = [outcome.updated for outcome in outcomes]
    assert updates[0] and sum(updates) >= 5
    estimates = [outcome.estimate is not None for outcome in outcomes if outcome.updated]
    assert estimates[:5] == [True, True, False, True, False]        # fresh, then every second


def test_at_rest_there_is_one_update_and_one_more_if_asked():
    found = localizer()
    beams, odom = scan(START), compose(ODOM, START)
    assert [found.process("laser", beams, odom).updated for _ in range(4)] == [True, False, False, False]
    found.force_update()
    assert [found.process("laser", beams, odom).updated for _ in range(2)] == [True, False]


def test_each_laser_updates_once_a_move():
    found = localizer()
    beams, odom = scan(START), compose(ODOM, START)
    assert [found.process(laser, beams, odom).updated for laser in ("one", "two", "one", "two")] == [
        True, True, False, False]


def test_a_scan_without_hits_changes_nothing_and_the_next_counts():
    found = localizer()
    beams, odom = scan(START), compose(ODOM, START)
    blind = type(beams)(beams.ends, beams.polar, np.zeros(len(beams.hit), bool), beams.mount, beams.reach)
    assert not found.process("laser", blind, odom).updated
    assert found.process("laser", beams, odom).updated


@pytest.mark.parametrize("matching", [True, False])
def test_a_robot_that_was_carried_away_is_doubted(matching):
    found = localizer(scan_matching=matching, recovery_alpha_slow=0.0)
    _, outcomes = drive(found, steps=8)
    assert [doubt(each.share, each.weight) for each in outcomes[1:]] == [""] * 7
    outcome = found.process("laser", scan(np.array([3.6, 2.6, 2.2])), compose(ODOM, START))
    assert "only " in doubt(outcome.share, outcome.weight)


def test_global_localization_finds_the_robot():
    found = localizer()
    found.start_anywhere()
    errors, _ = drive(found, start=np.array([3.2, 2.4, 1.0]), steps=12)
    assert np.hypot(*errors[-1, :2]) < 0.05 and abs(errors[-1, 2]) < np.radians(2.0)


def test_the_covariance_is_that_of_the_published_pose_only():
    found = localizer(min_particles=400)
    particles = found.filter
    particles.poses[:150] += [2.5, 0.5, 2.0]        # a second group elsewhere
    outcome = found.process("laser", scan(START), compose(ODOM, START))
    assert outcome.estimate is not None
    assert np.sqrt(outcome.estimate.covariance[0, 0]) < 0.3


@pytest.mark.parametrize("change", [{"laser_model_type": "beam"}, {"max_particles": 300, "min_particles": 50}])
def test_other_parameters_start_again_around_the_newest_pose(change):
    found = localizer()
    drive(found)
    last = found.last.pose
    found.configure(settings(**change))
    assert np.hypot(*(found.filter.poses.mean(axis=0) - last)[:2]) < 0.1
    assert len(found.filter.poses) == change.get("max_particles", 5000)


def test_another_map_forgets_where_odometry_is():
    found = localizer()
    drive(found)
    found.set_map(room())
    assert found.map_from_odom is None and found.last is None
