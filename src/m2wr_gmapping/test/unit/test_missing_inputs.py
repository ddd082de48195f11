# SPDX-License-Identifier: BSD-3-Clause
"""Sentences on what is missing: what there is, what was expected, who usually brings it."""
import pytest

from m2wr_gmapping.ros.missing_inputs import no_scan, usual_source

SCAN = "sensor_msgs/LaserScan"


@pytest.mark.parametrize("published, wanted", [
    ([], "nobody publishes it; topics with scans: none"),
    ([("/scan", SCAN)], "its publisher is silent; topics with scans: /scan"),
    ([("/scan", "sensor_msgs/PointCloud2")], "what is published there is a sensor_msgs/PointCloud2"),
    ([("/b/scan", SCAN), ("/a/scan", SCAN)],
     "topics with scans: /a/scan, /b/scan. One of them is taken with scan:=/a/scan"),
])
def test_scans_that_do_not_come(published, wanted):
    assert wanted in no_scan("/scan", published)


@pytest.mark.parametrize("frames, newest, wanted", [
    (set(), None, "Expected a robot or simulator"),
    ({"base", "laser"}, None, "Nobody publishes odom, which the parameter odom_frame names"),
    ({"odom", "base"}, None, "Nobody says where laser sits: robot_state_publisher"),
    ({"odom", "laser"}, None, "nothing joins them"),
    ({"odom", "laser"}, 1.7e9, "1699999900.0 s apart: expected the same clock"),
])
def test_transforms_that_do_not_come(frames, newest, wanted):
    assert wanted in usual_source("odom", "laser", frames, newest, 100.0, "odom_frame")


@pytest.mark.parametrize("newest", [0.0, 99.9])
def test_nothing_is_guessed_where_a_transform_is_only_late(newest):
    assert usual_source("odom", "laser", {"odom", "laser"}, newest, 100.0, "odom_frame") == ""


def test_a_base_that_nobody_knows_is_a_question_of_its_parameter():
    assert "which the parameter base_frame names" in usual_source("base", "laser", {"odom"}, None, 1.0, "base_frame")
