# SPDX-License-Identifier: BSD-3-Clause
"""Sentences on what is missing: what there is, what was expected, who usually brings it."""

import pytest
import rospy

from m2wr_maps.ros.missing_inputs import no_scan, usual_source, warn_about_missing_inputs

SCAN = "sensor_msgs/LaserScan"


@pytest.mark.parametrize("published, wanted", [
    ([], "it has no publisher; topics with scans: none"),
    ([("/scan", SCAN)], "its publisher sends nothing; topics with scans: /scan"),
    ([("/scan", "sensor_msgs/PointCloud2")], "its type is sensor_msgs/PointCloud2"),
    ([("/b/scan", SCAN), ("/a/scan", SCAN)],
     "topics with scans: /a/scan, /b/scan. Use one of them with scan:=/a/scan"),
])
def test_missing_scans(published, wanted):
    assert wanted in no_scan("/scan", published)


@pytest.mark.parametrize("frames, newest, wanted", [
    (set(), None, "Expected a robot or simulator"),
    ({"base", "laser"}, None, "No node publishes odom, the value of the parameter odom_frame"),
    ({"odom", "base"}, None, "No node publishes laser: expected robot_state_publisher"),
    ({"odom", "laser"}, None, "not connected"),
    ({"odom", "laser"}, 1.7e9, "1699999900.0 s apart: expected the same clock"),
])
def test_missing_transforms(frames, newest, wanted):
    assert wanted in usual_source("odom", "laser", frames, newest, 100.0, "odom_frame")


@pytest.mark.parametrize("newest", [0.0, 99.9])
def test_late_transform_gives_no_advice(newest):
    assert usual_source("odom", "laser", {"odom", "laser"}, newest, 100.0, "odom_frame") == ""


def test_unknown_base_names_its_parameter():
    assert "the value of the parameter base_frame" in usual_source("base", "laser", {"odom"}, None, 1.0, "base_frame")


def test_missing_clock_and_scans_are_named_at_start(monkeypatch):
    told, naps = [], iter([False] * 3 + [True] * 100)

    class Nothing:
        arrived = 0
    monkeypatch.setattr(rospy.rostime, "wallsleep", lambda _: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: next(naps))
    monkeypatch.setattr(rospy, "get_published_topics", lambda: [["/front/scan", "sensor_msgs/LaserScan"], ["/x", "y"]])
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: told.append(text % values))
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy, "get_time", lambda: 0.0)
    warn_about_missing_inputs(Nothing(), "/robot/scan")
    assert "/clock" in told[0] and "use_sim_time" in told[0]
    assert "/robot/scan" in told[1] and "/front/scan" in told[1]


def test_missing_clock_is_named_even_with_scans(monkeypatch):
    told, clock = [], iter([0.0, 0.0, 5.0])

    class Scans:
        arrived = 7
    monkeypatch.setattr(rospy.rostime, "wallsleep", lambda _: None)
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: told.append(text % values))
    monkeypatch.setattr(rospy.rostime, "is_wallclock", lambda: False)
    monkeypatch.setattr(rospy, "get_time", lambda: next(clock))
    warn_about_missing_inputs(Scans(), "/scan")
    assert len(told) == 2 and "/clock" in told[0]
