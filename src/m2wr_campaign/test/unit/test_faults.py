# SPDX-License-Identifier: BSD-3-Clause
"""Faults change exactly what they say, and a study has them as a factor."""
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from m2wr_campaign.faults.fault import seen_through
from m2wr_campaign.faults.registry import FAULTS, make_fault
from m2wr_campaign.runner.one_run import perform
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.factors import StudyFault
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study
from m2wr_sim.api import Observation, Odometry, StepResult

STUDY = """
study: faulty
limit: 60
worlds: [{file: world02, start: [0, 8], goal: [0, 6]}]
methods: [potential_field]
faults: %s
"""
PERIOD = 0.05


@dataclass(frozen=True)
class Scan:
    number: int
    ranges: np.ndarray


def fault(name, seed=1, **parameters):
    return make_fault(name, parameters, seed)


def scans(one, count=200, beams=50):
    """Return the numbers of the scans that a method gets; a new scan every second cycle."""
    made = [Scan(number, np.full(beams, 2.0)) for number in range(count // 2)]
    return [one.scan(cycle * PERIOD, made[cycle // 2]).number for cycle in range(count)]


def tasks(tmp_path, faults):
    path = tmp_path / "s.yaml"
    path.write_text(STUDY % faults)
    return all_tasks(read_study(str(path)))


# ---- the laser ---------------------------------------------------------------------------------------------------

def test_a_stopped_laser_repeats_its_last_scan_for_a_while():
    got = scans(fault("laser_stops", start=2.0, duration=3.0))
    true = [cycle // 2 for cycle in range(200)]
    assert got[:40] == true[:40] and set(got[40:100]) == {19} and got[100:] == true[100:]


def test_lost_scans_have_their_share_and_depend_on_the_seed():
    got = scans(fault("scan_loss", share=0.4), 4000)
    arrived = len(set(got)) / 2000
    assert arrived == pytest.approx(0.6, abs=0.04) and got == sorted(got)
    assert got == scans(fault("scan_loss", share=0.4), 4000) != scans(fault("scan_loss", seed=2, share=0.4), 4000)


def test_late_scans_are_late_by_the_delay():
    got = scans(fault("scan_delay", delay=0.5))
    assert got[10:] == [cycle // 2 for cycle in range(190)] and set(got[:10]) == {0}


def test_blind_beams_are_the_same_in_every_scan():
    one = fault("blind_beams", share=0.3)
    first, second = (one.scan(0.0, Scan(number, np.full(1000, 2.0, np.float32))).ranges for number in range(2))
    assert np.array_equal(first, second) and first.dtype == np.float32
    assert np.isinf(first).mean() == pytest.approx(0.3, abs=0.05) and set(first[np.isfinite(first)]) == {2.0}
    assert one.scan(0.0, None) is None


# ---- the pose ----------------------------------------------------------------------------------------------------

def test_drift_along_a_straight_line_is_an_arc():
    one = fault("odometry_drift", distance=1.1, turn=0.05)
    for step in range(2001):
        told = one.pose(0.0, (1.0 + 0.005 * step, 2.0, 0.0))
    radius, way = 1.1 / 0.05, 1.1 * 10.0
    turn = way / radius
    assert told == pytest.approx((1.0 + radius * math.sin(turn), 2.0 + radius * (1.0 - math.cos(turn)), turn), abs=5e-3)


def test_drift_of_a_turn_on_the_spot_is_its_factor():
    one = fault("odometry_drift", distance=1.0, rotation=1.02, turn=0.0)
    for step in range(1001):
        told = one.pose(0.0, (0.0, 0.0, math.remainder(0.01 * step, 2.0 * math.pi)))
    assert told == pytest.approx((0.0, 0.0, math.remainder(10.2, 2.0 * math.pi)), abs=1e-9)


def test_a_jump_is_in_the_robots_frame_and_moves_on_with_it():
    one = fault("pose_jump", start=1.0, x=1.0, y=0.0, yaw=math.pi / 2)
    assert one.pose(0.9, (5.0, 5.0, math.pi / 2)) == (5.0, 5.0, math.pi / 2)
    assert one.pose(1.0, (5.0, 5.0, math.pi / 2)) == pytest.approx((5.0, 6.0, math.pi))
    assert one.pose(2.0, (5.0, 7.0, math.pi / 2)) == pytest.approx((3.0, 6.0, math.pi))


# ---- commands ----------------------------------------------------------------------------------------------------

def test_late_commands_leave_the_robot_standing_first():
    one = fault("command_delay", delay=0.15)
    got = [one.command(cycle * PERIOD, cycle, -cycle) for cycle in range(6)]
    assert got == [(0.0, 0.0)] * 3 + [(0, 0), (1, -1), (2, -2)]


def test_a_pull_to_one_side_grows_with_the_speed():
    assert fault("pulls_aside", curvature=0.2).command(0.0, 0.5, 0.3) == (0.5, pytest.approx(0.4))
    assert fault("pulls_aside", curvature=0.2).command(0.0, 0.0, 0.3) == (0.0, 0.3)


# ---- in a study --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("name", sorted(FAULTS))
def test_what_a_fault_does_not_name_stays(name):
    odometry = Odometry(1.0, (1.0, 2.0, 0.0), (0.0, 0.0, 0.0, 1.0), 0.3, 0.0, 0.1)
    here = Observation((1.0, 2.0, 0.1), (0.0, 0.0, 0.0, 1.0), odometry, None, ())
    result = StepResult(20.0, {"m2wr": here})
    seen = seen_through(fault(name), result)
    assert seen.time == 20.0 and seen["m2wr"].scan is None and seen.odometry.linear_x == 0.3
    assert seen.pose == pytest.approx(result.pose, abs=1e-12) or FAULTS[name].MOVES_POSE
    assert result["m2wr"] is here
    for parameter in FAULTS[name].PARAMETERS.values():
        assert parameter.low <= parameter.default <= parameter.high


def test_faults_are_a_factor_whose_runs_are_pairs(tmp_path):
    made = tasks(tmp_path, "[none, scan_loss, {name: odometry_drift, parameters: {turn: [0.0, 0.02]}}]")
    assert [task.fault.label for task in made] == [
        "", "scan_loss", "odometry_drift turn=0", "odometry_drift turn=0.02"]
    assert len({task.key for task in made}) == 4 and len({task.seed for task in made}) == 1
    assert made[0].key == replace(made[1], fault=StudyFault()).key
    assert [task.factors()["fault"] for task in made] == [task.fault.label for task in made]


@pytest.mark.parametrize("faults, told", [
    ("[scan_los]", "faults[0].name: read 'scan_los'; expected one of none, laser_stops"),
    ("[{name: scan_loss, parameters: {share: 1.5}}]", "faults[0].parameters.share: read 1.5; expected a number from 0"),
    ("[none, none]", "faults: read 'none'; expected each fault once"),
    ("[{name: scan_loss, share: 0.5}]", "share is not known"),
])
def test_faults_that_cannot_be_used_are_told(tmp_path, faults, told):
    with pytest.raises(StudyError) as error:
        tasks(tmp_path, faults)
    assert told in str(error.value) and "\n" not in str(error.value)


def test_a_robot_that_takes_itself_for_arrived_has_missed(tmp_path):
    sound, off = (perform(task) for task in tasks(
        tmp_path, "[none, {name: pose_jump, parameters: {start: 0.0, x: 1.0, yaw: 0.0}}]"))
    assert sound["outcome"] == "reached" and sound["success"] == 1 and sound["fault"] == ""
    assert off["outcome"] == "missed" and off["success"] == 0 and off["fault"] == "pose_jump start=0 x=1 yaw=0"
    assert "it took itself for arrived" in off["reason"] and off["contacts"] == 0


def test_a_fault_changes_the_run_and_is_repeatable(tmp_path):
    sound, slow = tasks(tmp_path, "[none, {name: command_delay, parameters: {delay: 1.0}}]")
    rows = [perform(task) for task in (sound, slow, slow)]
    assert rows[1]["time"] > rows[0]["time"] + 0.5
    assert rows[1]["path"] == rows[2]["path"] != rows[0]["path"]
