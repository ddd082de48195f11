#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Twenty clients call conflicting services at once: every call is answered, and the simulation continues."""
import os
import sys
import threading
import time
import unittest

import rospy

from gazebo_msgs.msg import LinkState, ModelState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import PATIENCE, SERVICES, Simulation, data_text, make_pose, run_checks, wait_until  # noqa: E402

CLIENTS, ROUNDS = 20, 10


class Client(threading.Thread):
    """Calls the services one after another over connections of its own, and keeps the answers."""

    def __init__(self, number, start):
        super().__init__(daemon=True)
        self.number, self._start_line = number, start
        self.answers, self.failures, self.waiting = 0, [], ""
        self._proxies = {}

    def call(self, name, *arguments):
        """Call a service; any answer is fine, an exception is not."""
        if name not in self._proxies:
            self._proxies[name] = rospy.ServiceProxy("/gazebo/" + name, SERVICES[name], persistent=True)
        self.waiting = name
        try:
            answer = self._proxies[name](*arguments)
        except (rospy.ServiceException, rospy.ROSException) as error:
            self.failures.append("%s: %s" % (name, error))
            return None
        self.answers += 1
        return answer

    def run(self):
        name, crate = "crate%d" % self.number, data_text("crate.sdf")
        self._start_line.wait(PATIENCE)
        for turn in range(ROUNDS):
            spawned = self.call("spawn_sdf_model", name, crate, "", make_pose(self.number, turn), "")
            if spawned is None or not spawned.success:
                self.failures.append("spawn of %s: %s" % (name, spawned))
            self.call("get_model_state", name, "crate%d" % ((self.number + 1) % CLIENTS))
            self.call("set_model_state", ModelState(model_name=name, pose=make_pose(self.number, -turn)))
            self.call("set_link_state", LinkState(link_name=name + "::link", pose=make_pose(self.number, -turn)))
            self.call("get_world_properties")
            self.call("pause_physics" if self.number % 2 else "unpause_physics")
            self.call("get_physics_properties")
            if turn % 5 == 4 and self.number % 4 == 0:
                self.call("reset_world")
            deleted = self.call("delete_model", name)
            if deleted is None or not deleted.success:
                self.failures.append("delete of %s: %s" % (name, deleted))
        self.waiting = ""


class ManyClients(unittest.TestCase):
    """Many clients of one simulation."""

    def test_every_call_is_answered_and_time_advances(self):
        simulation = Simulation()
        simulation.wait_for_model("ground_plane")
        start = threading.Barrier(CLIENTS + 1)
        clients = [Client(number, start) for number in range(CLIENTS)]
        for client in clients:
            client.start()
        start.wait(PATIENCE)
        deadline = time.monotonic() + PATIENCE
        for client in clients:
            client.join(max(0.0, deadline - time.monotonic()))
            self.assertFalse(client.is_alive(), "client %d still waits for %s after %d answers"
                             % (client.number, client.waiting, client.answers))
        self.assertEqual([failure for client in clients for failure in client.failures], [])
        self.assertGreaterEqual(min(client.answers for client in clients), 8 * ROUNDS)
        self.assertEqual(simulation.models(), ["ground_plane"])
        simulation.call("unpause_physics")
        before = simulation.time()
        wait_until(lambda: simulation.time() > before + 0.1, "time to advance")


if __name__ == "__main__":
    rospy.init_node("check_many_clients", disable_rostime=True)
    run_checks("many_clients", ManyClients)
