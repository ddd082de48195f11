# SPDX-License-Identifier: BSD-3-Clause
"""Plays a recorded bag into one node, synchronised with it, and collects its answers.

Unlike ``rosbag play`` it does not follow the wall clock: it publishes the time itself and continues when the node has
answered.  So a test is as fast as the node, and does not fail on a busy machine.
"""
import ast
import os
import threading

import rosbag
import rospkg
import rospy
import yaml
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock, Log
from sensor_msgs.msg import LaserScan
from std_srvs.srv import SetBool

from graph_wait import ANSWER_TIME, START_TIME, wait_for_connection, wait_until

SCAN, ODOM, COMMAND = "/m2wr/laser/scan", "/odom", "/cmd_vel"
TYPES = {SCAN: LaserScan, ODOM: Odometry}
#: Period of the nodes' 20 Hz loops [ns].
TURN_NS = 50000000
#: Loop periods before the first message of a bag in which a node may begin to answer; periods of rest before those.
LEAD_IN, REST = 20, 20
#: Time of the clock before the first message of a bag [ns]; rospy treats time 0 as "no clock yet".
START_NS = 10 * 10**9


class Fixture:
    """A bag of test/data and the YAML beside it.

    Attributes
    ----------
    info : dict
        The YAML.
    messages : list of (str, message, int)
        Topic, message and stamp [ns] in order of time.
    """

    def __init__(self, name, topics):
        self.folder = os.path.join(rospkg.RosPack().get_path("m2wr_test"), "data")
        with open(os.path.join(self.folder, name + ".yaml"), encoding="utf-8") as stream:
            self.info = yaml.safe_load(stream)
        with rosbag.Bag(os.path.join(self.folder, self.info["bag"])) as bag:
            self.messages = [(topic, message, stamp.to_nsec()) for topic, message, stamp in bag.read_messages(topics)]
        if not self.messages:
            raise AssertionError("%s.bag holds nothing on %s" % (name, ", ".join(topics)))

    def world(self):
        """Return the path of the world file the bag was made in."""
        return os.path.join(self.folder, self.info["world"])


class Player:
    """The environment of one node: clock, sensors, its switch, and a recorder of its commands and log lines.

    Parameters
    ----------
    node : str
        Name of the tested node; the player waits until all connections to it exist.
    topics : list of str
        Sensor topics it subscribes to.
    commands : bool
        Whether it publishes /cmd_vel.
    others : sequence of str
        Further nodes whose log lines are collected.

    Attributes
    ----------
    commands : list of (int, (float, float))
        Clock [ns] and command (linear_x, angular_z) of everything that came on /cmd_vel.
    log : list of rosgraph_msgs.msg.Log
        Everything the node and the others have logged.
    """

    def __init__(self, node, topics, commands=True, others=()):
        self.node, self.commands, self.log = node, [], []
        self._others = tuple(others)
        self.now_ns = START_NS
        self._shift_ns = 0
        self._lock = threading.Lock()
        self._clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self._topics = {topic: rospy.Publisher(topic, TYPES[topic], queue_size=100) for topic in topics}
        rospy.Subscriber("/rosout", Log, self._on_log, queue_size=1000)
        rospy.Subscriber(COMMAND, Twist, self._on_command, queue_size=1000)
        for name in (node,) + self._others:
            for topic in ["/clock"] + (list(topics) if name == node else []):
                wait_for_connection(name, "o", topic)
            for topic in ["/rosout"] + ([COMMAND] if commands and name == node else []):
                wait_for_connection(name, "i", topic)

    def also_to(self, topic, node):
        """Wait until another node also receives a sensor topic; advertise the topic if needed."""
        if topic not in self._topics:
            self._topics[topic] = rospy.Publisher(topic, TYPES[topic], queue_size=100)
        wait_for_connection(node, "o", topic)

    def _on_log(self, message):
        if message.name in (self.node,) + self._others:
            self.log.append(message)

    def _on_command(self, message):
        with self._lock:
            self.commands.append((self.now_ns - self._shift_ns, (message.linear.x, message.angular.z)))

    def lines(self, level=Log.INFO, start=0, node=None):
        """Return the texts of a node's log lines of a level, from the ``start``-th entry of :attr:`log` on."""
        return [message.msg for message in self.log[start:]
                if message.level == level and message.name == (node or self.node)]

    def lists(self, node=None):
        """Return the lists of numbers that a node has logged."""
        return [ast.literal_eval(line) for line in self.lines(node=node) if line.startswith("[")]

    def begin(self, first_ns):
        """Let the next bag, whose first stamp is ``first_ns``, begin two seconds after what was played before."""
        with self._lock:
            self._shift_ns = self.now_ns + (LEAD_IN + REST) * TURN_NS - first_ns

    def set_clock(self, stamp_ns):
        """Publish the time of a bag."""
        with self._lock:
            self.now_ns = stamp_ns + self._shift_ns
        self._clock.publish(Clock(rospy.Time(self.now_ns // 10**9, self.now_ns % 10**9)))

    def publish(self, topic, message, stamp_ns):
        """Publish a message of a bag with its stamp moved to the present time of the clock."""
        moved_ns = stamp_ns + self._shift_ns
        message.header.stamp = rospy.Time(moved_ns // 10**9, moved_ns % 10**9)
        self._topics[topic].publish(message)

    def lead_in(self, messages, first_ns):
        """Publish (topic, message) pairs repeatedly until a bag begins; the node must have sent a command by then.

        A node receives messages and the clock in different threads, and sends no command before the first message.
        So the first periods of its loop may pass without a command.
        """
        before = len(self.commands)
        for stamp_ns in range(first_ns - LEAD_IN * TURN_NS, first_ns, TURN_NS):
            for topic, message in messages:
                self.publish(topic, message, stamp_ns)
            if len(self.commands) > before:
                self.turn(stamp_ns)
                continue
            self.set_clock(stamp_ns)
            try:
                wait_until(lambda: len(self.commands) > before, "", ANSWER_TIME / LEAD_IN)
            except AssertionError:
                continue
        if len(self.commands) == before:
            raise AssertionError("%s sent no command in %d periods" % (self.node, LEAD_IN))

    def turn(self, stamp_ns):
        """Advance the clock by one period of the node's loop and wait for its command; returns the newest one."""
        before = len(self.commands)
        self.set_clock(stamp_ns)
        wait_until(lambda: len(self.commands) > before, "a command of %s at %.3f s" % (self.node, stamp_ns * 1e-9))
        return self.commands[-1][1]

    def switch(self, service, value):
        """Call one of the switches; the answer must be that of the report."""
        rospy.wait_for_service(service, START_TIME)
        answer = rospy.ServiceProxy(service, SetBool)(value)
        if not answer.success or answer.message != "Done!":
            raise AssertionError("%s(%s) answered %s, expected success and \"Done!\"" % (service, value, answer))
