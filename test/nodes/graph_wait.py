# SPDX-License-Identifier: BSD-3-Clause
"""Waiting with a deadline and a description of the condition; connections between this process and a node."""
import time
from xmlrpc.client import ServerProxy

import rosgraph
import rospy

#: Wall seconds allowed for an immediate answer, and for the start of a node.
ANSWER_TIME, START_TIME = 20.0, 60.0


def wait_until(condition, what, seconds=ANSWER_TIME, pause=0.001):
    """Wait until ``condition()`` holds; AssertionError with ``what`` (a text or a function) when time is up.

    ``pause`` is the wall time [s] between two checks.
    """
    end = time.monotonic() + seconds
    while not condition():
        problem = None
        if time.monotonic() > end:
            problem = "waited %g s for" % seconds
        elif rospy.is_shutdown():
            problem = "ROS went down during the wait for"
        if problem:
            raise AssertionError("%s %s" % (problem, what() if callable(what) else what))
        time.sleep(pause)


def connections(node):
    """Return the connections between this process and a node: {("o" to it or "i" from it, topic)}.

    The number of connections is not enough: a test also receives its own clock and log.
    """
    try:
        address = rosgraph.Master(rospy.get_name()).lookupNode(node)
    except rosgraph.MasterException:
        return set()        # not registered yet
    _, _, found = ServerProxy(rospy.get_node_uri()).getBusInfo(rospy.get_name())
    return {(entry[2], entry[4]) for entry in found if entry[1] in (node, address) and entry[5]}


def wait_for_connection(node, direction, topic):
    """Wait until a node subscribes to this process ("o") or publishes to it ("i") on a topic."""
    wait_until(lambda: (direction, topic) in connections(node), "%s to %s %s" % (
        node, {"o": "subscribe to", "i": "publish"}[direction], topic), START_TIME, pause=0.02)
