#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A controller for the tests of lockstep: ``lockstep_puppet.py NAME BEHAVIOUR [TURN]``.

From turn TURN on it drives (forward, always), blocks (never answers), fails (raises), dies (without output) or ends the
run; before that turn it drives.  As ``early`` it ends the run and has sent a command before its first turn; as
``shy`` it ends the run and has refused the first subscriber to its commands.  As ``answer`` it does not use lockstep
and sends one command for each scan.
"""
import os
import sys
import threading

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rospy.impl.masterslave import ROSHandler
from sensor_msgs.msg import LaserScan

from m2wr_lockstep.controller import Controller


class Puppet:
    """Counts turns and messages, and fails as requested."""

    def __init__(self, behaviour, at):
        self.behaviour, self.at, self.turns, self.scans, self.odometries = behaviour, at, 0, 0, 0
        self.controller = Controller()
        self.controller.note = "driving"
        self.commands = self.controller.publisher("/cmd_vel", Twist)
        self.controller.subscribe("/odom", Odometry, self.on_odometry)
        self.controller.subscribe("/m2wr/laser/scan", LaserScan, self.on_scan)

    def on_odometry(self, _):
        """Count."""
        self.odometries += 1

    def on_scan(self, message):
        """Count; the newest scan must belong to this turn."""
        self.scans += 1
        self.newest = message.header.stamp

    def turn(self, now):
        """Count the turn and behave as requested."""
        self.turns += 1
        if self.turns == 1:
            print("puppet: first turn", flush=True)
        if self.newest.to_sec() != now or rospy.get_time() != now:
            raise AssertionError("turn at %s with a scan of %s and ROS time %s" % (
                now, self.newest.to_sec(), rospy.get_time()))
        if self.at is not None and self.turns >= self.at:
            if self.behaviour == "block":
                threading.Event().wait()
            if self.behaviour == "fail":
                raise RuntimeError("the puppet failed")
            if self.behaviour == "die":
                os._exit(3)
            if self.behaviour in ("end", "early", "shy"):
                print("puppet: %d turns, %d scans, %d odometries, %.3f s" % (
                    self.turns, self.scans, self.odometries, now))
                return 0
        command = Twist()
        command.linear.x = 0.3
        self.commands.publish(command)
        return None

    def time_reset(self):
        """Tell."""
        print("puppet: time reset after %d turns" % self.turns)


def answer_scans():
    """Send a command for each scan, as code for Gazebo does."""
    publisher = rospy.Publisher("/cmd_vel", Twist, queue_size=10)

    def on_scan(message):
        command = Twist()
        command.linear.x = 0.3 if min(message.ranges) > 1.0 else 0.0
        publisher.publish(command)

    rospy.Subscriber("/m2wr/laser/scan", LaserScan, on_scan, tcp_nodelay=True)
    rospy.spin()


def refuse_once(topic):
    """Refuse the first request for a topic, like a node that is not ready yet: a rospy subscriber then gives up."""
    wanted = ROSHandler.requestTopic

    def request(handler, caller, name, protocols):
        if name != topic:
            return wanted(handler, caller, name, protocols)
        ROSHandler.requestTopic = wanted
        print("puppet: refused %s" % caller, flush=True)
        return -1, "Not a publisher of [%s]" % name, []

    ROSHandler.requestTopic = request


def main():
    """Entry point."""
    name, behaviour = rospy.myargv(sys.argv)[1:3]
    if behaviour == "shy":
        refuse_once("/cmd_vel")
    rospy.init_node(name)
    if behaviour == "answer":
        answer_scans()
        return 0
    at = rospy.myargv(sys.argv)[3:]
    puppet = Puppet(behaviour, int(at[0]) if at else None)
    if behaviour == "early":
        puppet.commands.publish(Twist())
    return puppet.controller.spin(puppet.turn, puppet.time_reset)


if __name__ == "__main__":
    sys.exit(main())
