# SPDX-License-Identifier: BSD-3-Clause
"""A laser that stops: whatever drives the robot, it is told to stop within half a second, and the reason is said."""
import math
import threading
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import LaserScan

from closed_loop import ClosedLoop, made, world
from m2wr_navigation import registry
from m2wr_navigation.methods.method import RUNNING, Decision
from m2wr_navigation.ros import best_path_node, method_node, sensor_input
from motion_plan.ros_support import RATE_HZ

ALLOWED = 0.5               # s from the last scan to the command that stops the robot
LAST = 3.0                  # s: no scan after it
LIMITS = {"DWAPlannerROS": {"max_vel_y": 0.0, "min_vel_y": 0.0, "vy_samples": 1}}


class LaserStops(ClosedLoop):
    """Hears no scan after LAST, and asks the layer, as the node does."""

    def scans(self, rate):
        """Make the laser send at a rate [Hz] until LAST; take the time of the last scan."""
        self.every, self.heard, self.last = 1.0 / rate, self.supervisor.cycle, -math.inf
        source = self.local.obstacle_layers()[0].sources["scan"]
        add = source.add
        source.add = lambda observation, now: self.take(add, observation, now)
        self.supervisor.cycle = lambda now, situation, _: self.heard(
            now, situation, self.local.obstacle_layers()[0].late(now))

    def take(self, add, observation, now):
        if now <= LAST and now - self.last >= self.every - 1e-6:
            self.last = now
            add(observation, now)


@pytest.mark.parametrize("period", [0.05, 0.1])
@pytest.mark.parametrize("rate", [5.0, 20.0])
@pytest.mark.parametrize("name", sorted({registry.short_name(name) for name in registry.CONTROLLERS}))
def test_every_controller_is_stopped_within_half_a_second(name, rate, period):
    kind, values = made(registry.CONTROLLERS, name, **LIMITS.get(name, {}))
    loop = LaserStops(world(10.0), kind(values), (1.5, 5.0, 0.0), period=period)
    loop.scans(rate)
    assert loop.drive((8.5, 5.0, 0.0), LAST + 2.0) == ""
    commands, times = np.array(loop.commands), period * np.arange(len(loop.commands))
    assert commands[times < loop.last, 0].max() > 0.1           # it drove
    after = np.abs(commands[times > loop.last + ALLOWED + 1e-6])
    assert len(after) > 10 and not after.any()
    assert any("stopped: topic scan of source scan has been silent" in text for text in loop.messages), loop.messages


class Clock:
    """ROS time for nodes without a master."""

    def __init__(self, monkeypatch):
        self.now, self.told = 10.0, []
        monkeypatch.setattr(rospy, "get_time", lambda: self.now)
        monkeypatch.setattr(rospy, "resolve_name", lambda name: "/" + name)
        monkeypatch.setattr(rospy, "logwarn_throttle", lambda _, text: self.told.append(text))


def test_a_method_is_stopped_within_half_a_second(monkeypatch):
    clock, sent = Clock(monkeypatch), []
    node = object.__new__(method_node.MethodNode)
    node.__dict__.update(_lock=threading.RLock(), _driving=True, _closed=False, outcome=RUNNING,
                         _arrived={"scan": clock.now, "odom": clock.now}, _publisher=SimpleNamespace(
                             publish=lambda message: sent.append((clock.now, message.linear.x))))
    node._send(Decision(0.4, 0.0))
    # the timer that watches may begin anywhere between two scans
    for step in range(20):
        clock.now = 10.0 + (step + 0.99) * method_node.CHECKED
        node._arrived["odom"] = clock.now
        node._watch(None)
    stops = [when for when, speed in sent if speed == 0.0]
    assert min(stops) - 10.0 <= ALLOWED and "the robot stops: nothing on /scan" in clock.told[0]


def test_best_path_is_stopped_within_half_a_second(monkeypatch):
    clock, sent = Clock(monkeypatch), []
    node = object.__new__(best_path_node.BestPathNode)
    node.__dict__.update(
        _lock=threading.RLock(), _pose=None, _speed=None, _ended="", _waited=None, explores=False, _closed=False,
        _heard={best_path_node.SCAN_TOPIC: clock.now, "/odom": clock.now},
        _commands=SimpleNamespace(publish=lambda message: sent.append(clock.now)))
    turn = 1.0 / RATE_HZ
    while not sent and clock.now < 12.0:
        clock.now += turn
        node._heard["/odom"] = clock.now
        if clock.now - node._heard[best_path_node.SCAN_TOPIC] > best_path_node.OLD:
            assert node._turn(clock.now) is None
    assert sent and sent[0] - 10.0 <= ALLOWED and "the robot stops" in clock.told[0]


def test_a_scan_counts_when_it_arrives_not_when_it_is_used(monkeypatch):
    Clock(monkeypatch)
    heard = []
    node = object.__new__(sensor_input.SensorInput)
    node.__dict__.update(_lock=threading.Lock(), _waiting=[], _source=SimpleNamespace(heard=heard.append))
    node._on_message(LaserScan(header=rospy.Header(stamp=rospy.Time(9), frame_id="laser")))
    assert heard == [10.0]
