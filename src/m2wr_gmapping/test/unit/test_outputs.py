# SPDX-License-Identifier: BSD-3-Clause
"""Timing of the transform and the map thread, with simulated clocks."""
import threading

import numpy as np
import pytest
import rospy

from m2wr_gmapping.ros.outputs import LONGEST_WAIT, SHORTEST_WAIT, MapOutput, Pace
from m2wr_maps.saved_map import SavedMap

PERIOD = 0.05


def run(clock, wall_end, wall=1000.0):
    """Run a Pace on a clock (function of wall time) until ``wall_end``; return times sent and number of polls."""
    pace, passed, sent, looks = Pace(), 0.0, [], 0
    while passed < wall_end:
        now, looks = clock(passed), looks + 1
        if pace.due(now, PERIOD):
            sent.append(now)
        else:
            passed += pace.wait_time(now, wall + passed)
    return sent, looks


@pytest.mark.parametrize("factor", [0.1, 1.0, 4.0, 10.0])
def test_period_is_kept_at_any_clock_rate(factor):
    sent, looks = run(lambda passed: 5.0 + 0.01 * int(100 * factor * passed), 10.0)        # a clock of 10 ms steps
    assert len(sent) == pytest.approx(10.0 * factor / PERIOD, rel=0.1)
    assert looks < 10 * len(sent) + 10.0 / LONGEST_WAIT + 10


def test_missing_or_paused_clock_costs_little():
    for at in (0.0, 7.0):
        sent, looks = run(lambda _, at=at: at, 10.0)
        assert len(sent) == (1 if at else 0) and looks < 1.1 * 10.0 / LONGEST_WAIT + 5


def test_clock_that_jumps_back_is_followed():
    sent, _ = run(lambda passed: 100.0 + passed if passed < 2.0 else passed, 4.0)
    after = [now for now in sent if now < 50.0]
    assert after[0] < 2.0 + 2 * PERIOD and len(after) == pytest.approx(2.0 / PERIOD, rel=0.1)


def test_missed_transforms_are_not_sent_in_a_burst():
    sent, _ = run(lambda passed: 1.0 + passed if passed < 1.0 else 31.0 + passed, 2.0)
    assert len(sent) < 2.2 / PERIOD and min(b - a for a, b in zip(sent, sent[1:])) >= SHORTEST_WAIT


class Recorder:
    """Stand-in for publishers and services that records the published messages."""

    sent = []

    def __init__(self, name, *_, **__):
        self._name = name

    def publish(self, message):
        Recorder.sent.append((self._name, message))


class SlowMapper:
    """A mapper whose maps are finished when the test releases them."""

    entropy, given = 0.0, 0

    def __init__(self):
        self.go, self.begun, self.asked, self.stamps = threading.Semaphore(0), threading.Semaphore(0), 0, []

    def map_request(self):
        self.asked += 1
        self.stamps.append(float(self.asked))
        return np.full((self.asked, 3), float(self.asked)), []

    def map_of(self, path, readings):
        self.begun.release()
        assert self.go.acquire(timeout=60)
        return SavedMap(np.full((32, 32), len(path), np.int8), 0.05, np.zeros(2))

    @staticmethod
    def base_poses(poses):
        return poses


def test_map_thread_does_not_block_and_keeps_the_newest_request(monkeypatch):
    """gmapping builds the map in the callback of the scan."""
    monkeypatch.setattr(Recorder, "sent", [])
    monkeypatch.setattr(rospy, "Publisher", Recorder)
    monkeypatch.setattr(rospy, "Service", Recorder)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1))
    output, mapper = MapOutput("map"), SlowMapper()
    output.ask(mapper)
    assert mapper.begun.acquire(timeout=60)
    for _ in range(5):
        output.ask(mapper)              # would wait for ever if the map were made here
    assert output.made == 0 and mapper.asked == 6
    mapper.go.release(2)
    assert mapper.begun.acquire(timeout=60)
    output.close()
    maps = [message for name, message in Recorder.sent if name == "map"]
    assert [int(message.data[0]) for message in maps] == [1, 6]
    paths = [message for name, message in Recorder.sent if name == "~path"]
    assert [len(message.plane) for message in paths] == [1, 6]
