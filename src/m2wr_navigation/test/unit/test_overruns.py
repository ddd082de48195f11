# SPDX-License-Identifier: BSD-3-Clause
"""Warnings of loops that are slower than their rate."""
from types import SimpleNamespace

from m2wr_navigation.overruns import IN_A_ROW, OverrunMonitor
from m2wr_navigation.ros.costmap_server import CostmapServer


def test_some_long_cycles_in_a_row_are_a_warning_once_a_minute():
    monitor = OverrunMonitor()
    told = [now for now in range(200) if monitor.is_due(float(now), 0.3, 0.2)]
    assert told == [IN_A_ROW - 1, IN_A_ROW - 1 + 60, IN_A_ROW - 1 + 120, IN_A_ROW - 1 + 180]


def test_single_long_cycles_are_none():
    monitor = OverrunMonitor()
    assert not any(monitor.is_due(float(now), 0.3 if now % IN_A_ROW else 0.1, 0.2) for now in range(200))


def test_after_the_clock_was_set_back_the_warning_comes_again():
    monitor = OverrunMonitor()
    assert [now for now in range(100, 106) if monitor.is_due(float(now), 0.3, 0.2)] == [104]
    assert monitor.is_due(3.0, 0.3, 0.2)


def test_the_slowest_part_of_an_update_is_named():
    server = object.__new__(CostmapServer)
    spent = {"static_layer": 0.08, "inflation_layer": 0.01}
    server.__dict__.update(busy_ms=100.0, costmap=SimpleNamespace(spent=spent))
    assert server._slowest() == "static_layer: 80 ms"
    server.costmap.spent = {"static_layer": 0.01, "inflation_layer": 0.02}
    assert server._slowest() == "sensor data and messages: 70 ms"
    server.costmap.spent = {}
    assert server._slowest() == "sensor data and messages: 100 ms"
