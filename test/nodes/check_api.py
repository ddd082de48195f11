#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every topic and service of the graph, with its type: none missing, none unexpected."""
import os
import re
import sys
import unittest

import rosgraph
import rospy
import rosservice

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from documents import ROOT  # noqa: E402
from sim_probe import SERVICES, Simulation, run_checks, wait_until  # noqa: E402

PUBLISHED = {
    "/clock": "rosgraph_msgs/Clock", "/diagnostics": "diagnostic_msgs/DiagnosticArray", "/rosout": "rosgraph_msgs/Log",
    "/tf": "tf2_msgs/TFMessage", "/gazebo/model_states": "gazebo_msgs/ModelStates",
    "/gazebo/link_states": "gazebo_msgs/LinkStates", "/gazebo/performance_metrics": "gazebo_msgs/PerformanceMetrics",
    "/gazebo/world_markers": "visualization_msgs/MarkerArray",
    "/gazebo/ground_markers": "visualization_msgs/MarkerArray",
    "/gazebo/visual_markers": "visualization_msgs/MarkerArray", "/gazebo/robot_states": "gazebo_msgs/ModelStates",
    "/robot_description": "std_msgs/String",
    "/gazebo/parameter_descriptions": "dynamic_reconfigure/ConfigDescription",
    "/gazebo/parameter_updates": "dynamic_reconfigure/Config",
}
SUBSCRIBED = {"/gazebo/set_model_state": "gazebo_msgs/ModelState", "/gazebo/set_link_state": "gazebo_msgs/LinkState"}
ROBOT_PUBLISHED = {"/odom": "nav_msgs/Odometry", "/joint_states": "sensor_msgs/JointState",
                   "/m2wr/laser/scan": "sensor_msgs/LaserScan"}
ROBOT_SUBSCRIBED = {"/cmd_vel": "geometry_msgs/Twist"}
SERVICE_TYPES = dict({"/gazebo/" + name: kind._type for name, kind in SERVICES.items()},
                     **{"/gazebo/step": "std_srvs/Trigger", "/gazebo/set_parameters": "dynamic_reconfigure/Reconfigure",
                        "/gazebo/get_loggers": "roscpp/GetLoggers",
                        "/gazebo/set_logger_level": "roscpp/SetLoggerLevel"})
ELSEWHERE = ("/rosout_agg",)     # of the node rosout, where one runs


class Api(unittest.TestCase):
    """The graph as a master sees it."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.master = rosgraph.Master(rospy.get_name())

    def of_gazebo(self):
        """Topics that the simulation publishes, subscribes to, and its services, as three sorted lists."""
        return [sorted(name for name, nodes in part if "/gazebo" in nodes) for part in self.master.getSystemState()]

    def test_topics_and_services_of_the_simulation(self):
        published, subscribed, services = self.of_gazebo()
        self.assertEqual(published, sorted(dict(PUBLISHED, **ROBOT_PUBLISHED)))
        self.assertEqual(subscribed, sorted(dict(SUBSCRIBED, **ROBOT_SUBSCRIBED)))
        self.assertEqual(services, sorted(SERVICE_TYPES))

    def test_types_of_all_topics_of_the_graph(self):
        wait_until(lambda: "/m2wr_spawn" not in str(self.master.getSystemState()), "the end of spawn_model")
        expected = {}
        for part in (PUBLISHED, SUBSCRIBED, ROBOT_PUBLISHED, ROBOT_SUBSCRIBED):
            expected.update(part)
        publishers, subscribers, _ = self.master.getSystemState()
        known = {name for name, _ in publishers + subscribers}.difference(ELSEWHERE)
        self.assertEqual(dict(item for item in self.master.getTopicTypes() if item[0] in known), expected)

    def test_no_node_publishes_the_topics_the_simulation_reads(self):
        publishers = dict(self.master.getSystemState()[0])
        for topic in dict(SUBSCRIBED, **ROBOT_SUBSCRIBED):
            self.assertNotIn(topic, publishers)
        for topic in dict(PUBLISHED, **ROBOT_PUBLISHED):
            if topic != "/rosout":
                self.assertEqual(publishers[topic], ["/gazebo"], topic)

    def test_types_of_services(self):
        self.assertEqual({name: rosservice.get_service_type(name) for name in self.of_gazebo()[2]}, SERVICE_TYPES)

    def test_the_reference_lists_all_services(self):
        with open(os.path.join(ROOT, "docs", "reference", "services.md"), encoding="utf-8") as stream:
            listed = re.findall(r"^\| `(\w+)` \|", stream.read(), re.M)
        self.assertEqual(["/gazebo/" + name for name in listed], self.of_gazebo()[2])

    def test_use_sim_time_is_set(self):
        self.assertIs(rospy.get_param("/use_sim_time"), True)

    def test_topics_of_a_deleted_robot_disappear_and_come_back(self):
        self.simulation.call("delete_model", "m2wr")
        published, subscribed, services = self.of_gazebo()
        self.assertEqual(published, sorted(PUBLISHED))
        self.assertEqual(subscribed, sorted(SUBSCRIBED))
        self.assertEqual(services, sorted(SERVICE_TYPES))
        self.simulation.spawn("m2wr", rospy.get_param("/robot_description"))
        published, subscribed, _ = self.of_gazebo()
        self.assertEqual(published, sorted(dict(PUBLISHED, **ROBOT_PUBLISHED)))
        self.assertEqual(subscribed, sorted(dict(SUBSCRIBED, **ROBOT_SUBSCRIBED)))


if __name__ == "__main__":
    rospy.init_node("check_api", disable_rostime=True)
    run_checks("api", Api)
