# SPDX-License-Identifier: BSD-3-Clause
"""The doctor on frames: without a fault, and with each of the faults that it reports."""
import pytest

from doctor_machine import faults, make_graph, one_fault
from m2wr_tools.doctor import frames

EDGES = {("odom", "link_chassis"): frames.Edge({"/gazebo"}, -0.01, False),
         ("link_chassis", "sensor_laser"): frames.Edge({"/robot_state_publisher"}, None, True),
         ("link_chassis", "link_left_wheel"): frames.Edge({"/robot_state_publisher"}, -0.01, False)}


def make_seen(**changes):
    return frames.Seen(
        edges=dict(EDGES), scans={"/scan": frames.Stream(50, {("sensor_laser", None)}, [0.01])},
        odometry={"/odom": frames.Stream(50, {("odom", "link_chassis")}, [0.01])}, clock=(10.0, 12.5),
        links=["link_chassis", "sensor_laser", "link_left_wheel"])._replace(**changes)


def without(*pairs):
    return {pair: edge for pair, edge in EDGES.items() if pair not in pairs}


def test_a_sound_robot_has_no_faults():
    found = frames.check(make_graph(), make_seen())
    assert found and not faults(found)


@pytest.mark.parametrize("changes, level, words", [
    ({"clock": (10.0, 10.0), "scans": {"/scan": frames.Stream(0, set(), [])}}, "warning", ("not advance", "unpause")),
    ({"scans": {}}, "warning", ("no node publishes a laser scan",)),
    ({"scans": {"/scan": frames.Stream(0, set(), [])}}, "problem", ("/scan is advertised, but no scan", "log")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo", "/ekf"}, -0.01, False)}}, "problem",
     ("odom -> link_chassis is published by /ekf, /gazebo", "stop one")),
    ({"edges": {**EDGES, ("map", "link_chassis"): frames.Edge({"/amcl"}, -0.01, False)}}, "problem",
     ("link_chassis has 2 parents, map, odom",)),
    ({"edges": without(("link_chassis", "link_left_wheel"))}, "warning", ("link_left_wheel", "joint_states")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, 3.0, False)}}, "problem",
     ("3.0 s in the future", "use_sim_time")),
    ({"edges": {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, -9.0, False)}}, "warning",
     ("9.0 s old", "use_sim_time")),
    ({"scans": {"/scan": frames.Stream(50, {("sensor_laser", None)}, [1.6e9])}}, "problem", ("in the past", "clock")),
    ({"edges": without(("odom", "link_chassis"))}, "problem", ("no transform from odom to the laser's frame",)),
    ({"edges": {}}, "problem", ("there are no transforms", "robot_state_publisher"))])
def test_faults_of_frames(changes, level, words):
    one_fault(frames.check(make_graph(), make_seen(**changes)), level, *words)


def test_an_unknown_laser_frame():
    seen = make_seen(scans={"/scan": frames.Stream(9, {("laser", None)}, [0.01])})
    one_fault(frames.check(make_graph(), seen), "problem", "\"laser\" is not in any transform", "link_chassis")


@pytest.mark.parametrize("edges", [{}, without(("link_chassis", "sensor_laser"), ("link_chassis", "link_left_wheel"))])
def test_a_robot_without_frames_yet_is_no_problem(edges):
    alone = make_graph(subscribers={"/tf": ["/doctor_17_3"]})
    found = frames.check(alone, make_seen(edges=edges))
    assert not faults(found) and any("rvis.launch" in finding.what for finding in found)
    read = make_graph(subscribers={"/tf": ["/doctor_17_3", "/rviz"]})
    assert any(finding.level == "problem" for finding in frames.check(read, make_seen(edges=edges)))


def test_fast_time_ages_stamps_faster():
    edges = {**EDGES, ("odom", "link_chassis"): frames.Edge({"/gazebo"}, -9.0, False)}
    assert not faults(frames.check(make_graph(), make_seen(edges=edges, clock=(0.0, 50.0))))


def test_links_without_a_name_are_ignored():
    assert frames.links_of('<robot name="r"><link/><link name="base"/></robot>') == ["base"]


def test_a_ring_of_frames_ends():
    edges = {("a", "b"): frames.Edge({"/n"}, None, True), ("b", "a"): frames.Edge({"/n"}, None, True)}
    frames.check(make_graph(), make_seen(edges=edges))
