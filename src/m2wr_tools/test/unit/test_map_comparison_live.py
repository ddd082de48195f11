# SPDX-License-Identifier: BSD-3-Clause
"""The comparison beside a run ends with it."""
import threading

from m2wr_tools.map_comparison import command as compare_map


def test_an_end_that_is_told_before_it_is_known_is_seen(monkeypatch):
    """ROS calls what waits for its end before it says that it has ended."""
    hooks, ended = [], threading.Event()
    monkeypatch.setattr(compare_map, "LOOK", 0.05)
    monkeypatch.setattr(compare_map.rospy, "on_shutdown", hooks.append)
    monkeypatch.setattr(compare_map.rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(compare_map.rospy, "is_shutdown", ended.is_set)
    live = compare_map.LiveComparison(None)
    thread = threading.Thread(target=live.run, daemon=True)
    thread.start()
    for hook in hooks:
        hook()
    thread.join(0.2)
    ended.set()
    thread.join(5.0)
    assert hooks and not thread.is_alive()
