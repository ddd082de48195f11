# SPDX-License-Identifier: BSD-3-Clause
"""The nodes' /diagnostics: rates, ages, and detection of a stuck robot."""
import threading

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from motion_plan import ros_diagnostics
from motion_plan.ros_diagnostics import Diagnostics, Rates, Report, StuckWatch, judge

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
ON, OFF = Report(True, {}, ''), Report(False, {}, 'switched off')


@pytest.mark.parametrize('report, ages, stuck, missing, level, words', [
    (OFF, {'/odom': None}, False, ['/odom'], OK, 'switched off'),
    (ON, {'/odom': 0.1}, False, [], OK, 'driving'),
    (ON, {'/odom': None, '/scan': None}, False, ['/odom', '/scan'], ERROR, 'no message on /odom and /scan'),
    (ON, {'/odom': 0.1, '/scan': 2.5}, False, [], WARN, 'no new message on /scan (2.5 s)'),
    (ON, {'/odom': 0.1}, True, [], WARN, 'stuck')])
def test_judgement(report, ages, stuck, missing, level, words):
    found, message = judge(report, ages, stuck, missing)
    assert found == level and words in message


def watch(samples):
    """Return whether it is stuck after samples of (time, pose, command)."""
    found = StuckWatch()
    for sample in samples:
        found.add(*sample)
    return found.stuck()


def test_a_robot_that_ignores_its_command_is_stuck():
    assert watch([(t, (1.0, 2.0, 0.5), (0.3, 0.0)) for t in range(5)])
    assert watch([(t, (1.0, 2.0, 0.5), (0.0, 0.5)) for t in range(5)])


@pytest.mark.parametrize('samples', [
    [],
    [(t, (1.0, 2.0, 0.5), (0.3, 0.0)) for t in range(3)],                       # not long enough
    [(t, (1.0 + 0.3 * t, 2.0, 0.5), (0.3, 0.0)) for t in range(5)],             # drives
    [(t, (1.0, 2.0, 0.5 * t), (0.0, 0.5)) for t in range(5)],                   # turns
    [(t, (1.0, 2.0, 0.5), (0.0, 0.0)) for t in range(5)],                       # zero command
    [(t, (1.0, 2.0, 0.5), (0.3, 0.0) if t != 3 else (0.0, 0.0)) for t in range(5)],
    [(t, (1.0, 2.0, 0.5), None) for t in range(5)],                             # unknown command
    [(t, None, (0.3, 0.0)) for t in range(5)],
    [(t, (1.0, 2.0, 0.5), (0.3, 0.0)) for t in (10, 11, 12, 0, 1)]])            # time went back
def test_not_stuck(samples):
    assert not watch(samples)


def test_a_rotation_across_pi_is_small():
    assert watch([(t, (0.0, 0.0, 3.141 if t % 2 else -3.141), (0.3, 0.0)) for t in range(5)])


def test_rates_count_between_two_calls():
    rates = Rates()
    assert rates.look(1.0, {'/odom': 5}) == {'/odom': None}
    assert rates.look(3.0, {'/odom': 45}) == {'/odom': 20.0}
    assert rates.look(3.0, {'/odom': 50}) == {'/odom': None}        # time does not advance


class FakeSenses:
    """The input of a node."""

    def __init__(self):
        self.lock = threading.RLock()
        self.pose, self.odom_time, self.scan_time = (0.0, 0.0, 0.0), 9.5, 8.0
        self.counts = {'/odom': 40, '/scan': 20}


def test_a_message_holds_all_of_it(monkeypatch):
    monkeypatch.setattr(rospy, 'Publisher', lambda *_, **__: None)
    monkeypatch.setattr(ros_diagnostics.threading, 'Thread', lambda **_: type('T', (), {'start': lambda self: None})())
    monkeypatch.setattr(rospy, 'get_time', lambda: 10.0)
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time(10))
    node = Diagnostics('wall_follower', FakeSenses(), lambda: Report(True, {'state': 'find_wall'}, ''),
                       ('/odom', '/scan'), lambda: (0.2, -0.3))
    array = node.look()
    status, = array.status
    assert array.header.stamp == rospy.Time(10) and status.name == 'motion_plan: wall_follower'
    assert status.level == WARN and '/scan (2.0 s)' in status.message
    values = {pair.key: pair.value for pair in status.values}
    assert values['age of the newest on /odom [s]'] == '0.50' and values['state'] == 'find_wall'
    assert values['command'] == '0.20 m/s, -0.30 rad/s' and values['stuck'] == 'False'
