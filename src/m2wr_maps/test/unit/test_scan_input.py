# SPDX-License-Identifier: BSD-3-Clause
"""Scans and transforms on their way in: order, jumps in time, what is far ahead, left over or never comes."""
import threading
import time

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from m2wr_maps.ros.scan_input import BUFFER, Intake, Wording
from m2wr_maps.scan_account import AT_END, BAD_HEADER, EARLY, NO_TRANSFORM, OUT_OF_ORDER, QUEUE_FULL

WORDING = Wording("odom_frame", "base_frame", "set ~transform_publish_period to 0", "a new map is started")


def waiting_scan(frame, seconds):
    scan = LaserScan()
    scan.header.frame_id, scan.header.stamp = frame, rospy.Time.from_sec(seconds)
    return scan


def transform(parent, child, seconds):
    made = TransformStamped(child_frame_id=child)
    made.header.frame_id, made.header.stamp = parent, rospy.Time.from_sec(seconds)
    made.transform.rotation.w = 1.0
    return made


class FakeTime:
    """A clock that advances with every reading, and lets other threads run in between."""

    def __init__(self):
        self._lock, self._ticks = threading.Lock(), 0

    def now(self):
        with self._lock:
            self._ticks += 1
            found = rospy.Time(10 * self._ticks)            # so that two of them apart are a jump
        time.sleep(0)
        return found


def test_concurrent_clock_reads_are_no_jump(monkeypatch):
    clock = FakeTime()
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy.Time, "now", clock.now)
    intake = Intake("odom", 10, WORDING)

    def bring(count):
        for _ in range(count):
            intake._look_at_clock()

    threads = [threading.Thread(target=bring, args=(2000,)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert intake.generation == 0


def test_clock_jump_back_is_detected(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    intake = Intake("odom", 10, WORDING)
    for seconds, generation in ((10.0, 0), (11.0, 0), (11.0, 0), (9.9, 1), (10.0, 1)):
        monkeypatch.setattr(rospy.Time, "now", lambda seconds=seconds: rospy.Time.from_sec(seconds))
        scan = LaserScan()
        scan.header.stamp = rospy.Time.from_sec(seconds)
        intake.on_scan(scan)
        assert intake.generation == generation


def test_small_clock_offset_is_no_jump(monkeypatch):
    """As a bag that was recorded with its /clock gives them, beside that of its player."""
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)
    intake = Intake("odom", 10, WORDING)
    for k in range(100):
        for late in (0.0, 0.008):
            monkeypatch.setattr(rospy.Time, "now", lambda at=10.0 + 0.1 * k - late: rospy.Time.from_sec(at))
            intake.on_scan(waiting_scan("laser", 10.0 + 0.1 * k))
    assert intake.generation == 0


@pytest.fixture
def intake(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: True)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)         # it looks at the clock of a node
    monkeypatch.setattr(rospy, "loginfo", lambda *_: None)
    return Intake("odom", 500, WORDING)


def test_scans_leave_in_order_once_their_transform_is_known(intake):
    for k in range(10, 20):
        intake.on_scan(waiting_scan("laser", 0.1 * k))
    assert intake._ready() is None
    for seconds in (1.2, 1.45):         # it begins after the first two
        intake.on_transforms(TFMessage([transform("odom", "laser", seconds)]))
    found = [intake._ready() for _ in range(4)]
    assert [round(entry[0].header.stamp.to_sec(), 3) for entry in found[:3]] == [1.2, 1.3, 1.4]
    assert found[3] is None and intake.waiting == 5
    assert intake.account.unused == {EARLY: 2}


def test_scans_before_the_first_transform_are_not_dropped(intake):
    """Scans wait for late transforms; a scan without any transform is counted as dropped."""
    intake.on_transforms(TFMessage([transform("odom", "base", seconds) for seconds in (1.0, 1.1)]))
    for at in (0.95, 1.0, 1.05, 1.15):
        intake.on_scan(waiting_scan("laser", at))
    intake.on_scan(waiting_scan("other", 1.16))
    assert intake._ready() is None and intake.waiting == 5          # the mount of the laser is unknown yet
    intake.on_transforms(TFMessage([transform("base", "laser", 0.0)]), static=True)
    assert [round(intake._ready()[0].header.stamp.to_sec(), 3) for _ in range(2)] == [1.0, 1.05]
    assert intake._ready() is None and (intake.account.unused, intake.dropped, intake.waiting) == ({EARLY: 1}, 0, 2)
    intake.on_transforms(TFMessage([transform("odom", "base", 1.3)]))
    assert round(intake._ready()[0].header.stamp.to_sec(), 3) == 1.15
    intake.on_scan(waiting_scan("laser", 1.3))
    assert intake._ready() is not None
    assert intake.account.unused == {EARLY: 1, NO_TRANSFORM: 1}


def test_second_parent_of_odom_is_reported_once(monkeypatch):
    told = []
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: True)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *given: told.append(text % given))
    monkeypatch.setattr(rospy, "get_name", lambda: "/me")
    publishes = [False]
    intake = Intake("odom", 5, WORDING, "map", lambda: publishes[0])

    def send(parent, sender):
        message = TFMessage([transform(parent, "odom", 1.0), transform("odom", "laser", 1.0)])
        message._connection_header = {"callerid": sender}
        intake.on_transforms(message)

    send("map", "/other")
    assert not told                     # with transform_publish_period 0 another node has to
    publishes[0] = True
    for parent, sender in (("map", "/me"), ("/map", "/other"), ("map", "/other"), ("earth", "/third")):
        send(parent, sender)
    assert len(told) == 2 and "/other publishes map -> odom" in told[0] and "/third publishes earth -> odom" in told[1]


def test_unknown_frame_does_not_block_other_scans(intake):
    intake.on_scan(waiting_scan("nowhere", 1.0))
    intake.on_scan(waiting_scan("laser", 1.1))
    intake.on_transforms(TFMessage([transform("odom", "laser", 1.05), transform("odom", "laser", 1.2)]))
    assert intake._ready()[0].header.frame_id == "laser" and intake.account.unused == {NO_TRANSFORM: 1}


def stamps_taken(intake, seconds):
    """Bring scans one by one, each with a transform of its time; returns the stamps handed out."""
    taken = []
    for at in seconds:
        intake.on_scan(waiting_scan("laser", at))
        intake.on_transforms(TFMessage([transform("odom", "laser", at)]))
        found = intake._ready()
        while found is not None:
            taken.append(round(found[0].header.stamp.to_sec(), 3))
            found = intake._ready()
    return taken


@pytest.mark.parametrize("odd", [0.0, 1.0, 97.0])
def test_single_old_stamp_is_no_time_jump(intake, odd):
    intake.on_transforms(TFMessage([transform("odom", "laser", 90.0)]))
    good = [100.0, 100.1, 100.2, 100.3]
    for at in good:
        assert stamps_taken(intake, [at]) == [at]
        intake.on_scan(waiting_scan("laser", odd))
    assert intake.generation == 0 and intake.dropped == len(good)


def test_two_old_stamps_are_a_time_jump(intake):
    assert stamps_taken(intake, [100.0, 100.1, 50.0, 50.1, 50.2]) == [100.0, 100.1, 50.1, 50.2]
    assert intake.generation == 1


def test_late_scans_in_a_row_are_no_time_jump(intake):
    """As over a bad radio link: transforms arrive in time, some scans 1 to 2 s late."""
    taken = stamps_taken(intake, [100.0 + 0.1 * k for k in range(30)])
    for at in (101.0, 101.1, 101.2):
        intake.on_scan(waiting_scan("laser", at))
    assert stamps_taken(intake, [103.0]) == [103.0] and len(taken) == 30
    assert intake.generation == 0 and intake.account.unused == {OUT_OF_ORDER: 3}


@pytest.mark.parametrize("first", [True, False])
def test_scan_from_the_future_does_not_block_the_queue(intake, first):
    intake.on_transforms(TFMessage([transform("odom", "laser", 10.0)]))
    taken = stamps_taken(intake, [] if first else [10.1])
    intake.on_scan(waiting_scan("laser", 99999.0))
    taken += stamps_taken(intake, [10.2, 10.3, 10.4, 10.5])
    assert taken[-3:] == [10.3, 10.4, 10.5] and len(taken) == (3 if first else 5)
    assert intake.generation == 0


def test_transforms_from_before_a_jump_are_ignored(intake):
    assert stamps_taken(intake, [194.0, 194.1, 0.05, 0.1]) == [194.0, 194.1, 0.1]
    intake.on_transforms(TFMessage([transform("odom", "laser", 194.3)]))
    assert stamps_taken(intake, [0.2, 0.3]) == [0.2, 0.3] and intake.generation == 1


def test_second_transform_far_ahead_is_accepted(intake):
    intake.on_transforms(TFMessage([transform("odom", "laser", 10.0)]))
    assert stamps_taken(intake, [10.1]) == [10.1]
    intake.on_transforms(TFMessage([transform("odom", "laser", 5000.0)]))
    assert stamps_taken(intake, [10.2, 10.3, 300.0, 300.1]) == [10.2, 10.3, 300.1]


def test_stamps_out_of_range_for_tf2_are_refused(intake):
    for seconds in (2**31, 2**32 - 70, 2**32 - 1):          # each ended the process
        odd = transform("odom", "laser", 10.0)
        odd.header.stamp.secs = seconds
        intake.on_transforms(TFMessage([odd]))
        intake.on_transforms(TFMessage([odd]), static=True)
        scan = waiting_scan("laser", 10.0)
        scan.header.stamp.secs = seconds
        intake.on_scan(scan)
    assert intake.dropped == 3 and intake.waiting == 0
    intake.on_transforms(TFMessage([transform("odom", "laser", 10.0)]))
    assert stamps_taken(intake, [10.1]) == [10.1] and intake.generation == 0


def test_invalid_frame_id_is_refused(intake):
    intake.on_transforms(TFMessage([transform("odom", "las\0er", 10.0), transform("od\0om", "laser", 10.0),
                                    transform("odom", "laser", 10.0)]))
    intake.on_scan(waiting_scan("las\0er", 10.1))               # ended the filter's thread
    assert intake.dropped == 1 and intake.waiting == 0
    assert stamps_taken(intake, [10.2]) == [10.2]


def test_own_map_to_odom_transform_is_ignored(monkeypatch):
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: True)
    intake = Intake("odom", 5, WORDING, "map")
    intake.on_transforms(TFMessage([transform("/map", "odom", 1.0), transform("odom", "laser", 1.0)]))
    intake.on_transforms(TFMessage([transform("map", "beacon", 1.0), transform("earth", "odom", 1.0)]))
    assert intake._frames == {"odom", "laser", "map", "beacon", "earth"}
    assert not intake._buffer.can_transform_core("map", "odom", rospy.Time(1))[0]
    assert intake._buffer.can_transform_core("earth", "laser", rospy.Time(1))[0]


def test_waiting_scans_are_sorted_by_stamp(intake):
    for at in (1.0, 1.3, 1.1, 1.3, 1.2):
        intake.on_scan(waiting_scan("laser", at))
    intake.on_transforms(TFMessage([transform("odom", "laser", 1.0), transform("odom", "laser", 1.4)]))
    found = [intake._ready() for _ in range(5)]
    assert [entry and round(entry[0].header.stamp.to_sec(), 3) for entry in found] == [1.0, 1.1, 1.2, 1.3, None]
    intake.on_scan(waiting_scan("laser", 1.25))
    assert intake.waiting == 0 and intake.dropped == 2 and intake.generation == 0


def test_static_transform_is_sufficient(intake):
    intake.on_scan(waiting_scan("laser", 1.0))
    assert intake._ready() is None
    intake.on_transforms(TFMessage([transform("odom", "laser", 0.0)]), static=True)
    assert intake._ready() is not None


def test_full_queue_without_transforms_is_fast(intake, monkeypatch):
    asked = []

    class Buffer:
        def lookup_transform_core(self, target, source, stamp):
            asked.append(stamp)
            raise tf2_ros.ExtrapolationException("into the future")

        def get_latest_common_time(self, target, source):
            return rospy.Time(1)
    for k in range(400):
        intake.on_scan(waiting_scan("laser", 2.0 + 0.1 * k))
    monkeypatch.setattr(intake, "_buffer", Buffer())
    intake._look_up()
    assert intake._ready() is None and len(asked) == 1


def test_a_waiting_scan_keeps_its_transform(intake):
    stamps = [10.0 + 0.5 * k for k in range(400)]           # 200 s; the buffer holds 60 s
    assert stamps[-1] - stamps[0] > 3.0 * BUFFER
    intake.on_transforms(TFMessage([transform("odom", "laser", 9.9)]))
    for seconds in stamps:
        intake.on_scan(waiting_scan("laser", seconds))
        intake.on_transforms(TFMessage([transform("odom", "laser", seconds + 0.1)]))
    taken = [intake._ready() for _ in range(len(stamps) + 1)]
    assert [round(entry[0].header.stamp.to_sec(), 3) for entry in taken[:-1]] == stamps and taken[-1] is None
    assert not intake.account.unused


def test_scans_that_wait_at_the_end_are_counted(intake):
    intake.on_scan(waiting_scan("laser", 1.0))
    intake.on_scan(waiting_scan("laser", 1.1))
    intake.close()
    assert intake.next() is None
    assert intake.account.unused == {AT_END: 2} and intake.account.text() == (
        "2 of 2 scans not used (waiting at the end: 2)")


def test_lost_scans_are_counted_and_reported_by_reason(intake, monkeypatch):
    told = []
    monkeypatch.setattr(rospy, "logwarn", lambda text, *words: told.append(text % words if words else text))
    intake._limit = 4
    intake.on_transforms(TFMessage([transform("odom", "laser", 1.0)]))
    assert stamps_taken(intake, [1.1]) == [1.1]
    intake.on_scan(waiting_scan("laser", 1.1))              # the same again
    bad = waiting_scan("laser", 1.2)
    bad.header.stamp.secs = 2**32 - 1
    intake.on_scan(bad)
    intake.on_scan(waiting_scan("nowhere", 1.2))
    assert stamps_taken(intake, [1.3]) == [1.3]
    for k in range(7):
        intake.on_scan(waiting_scan("laser", 2.0 + k))
    assert intake.account.unused == {OUT_OF_ORDER: 1, BAD_HEADER: 1, NO_TRANSFORM: 1, QUEUE_FULL: 3}
    assert intake.dropped == 6
    assert len(told) == 4 and "odom -> nowhere" in told[2] and "the queue of 4 scans is full" in told[3]
    assert "so far 4 of 10 scans not used (bad header: 1, no transform: 1, out of order: 1, queue full: 1)" in told[3]
