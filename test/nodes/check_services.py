#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Links, joints, forces, physics, lights and dynamic parameters through ROS, as a client sees them."""
import os
import sys
import unittest

import rospy
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import Point, Twist, Vector3, Wrench
from sensor_msgs.msg import LaserScan

from gazebo_msgs.msg import LinkState, ODEJointProperties, PerformanceMetrics
from gazebo_msgs.srv import SetPhysicsPropertiesRequest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, data_text, make_pose, run_checks, wait_until, xyz  # noqa: E402


class Services(unittest.TestCase):
    """Every case begins with only the ground, unpaused."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.physics = cls.simulation.call("get_physics_properties")

    def setUp(self):
        self.simulation.delete_all()
        self.set_physics()
        self.simulation.call("unpause_physics")

    def call(self, name, text, *arguments, **fields):
        """Call a service that must succeed with a text."""
        answer = self.simulation.call(name, *arguments, **fields)
        self.assertEqual((answer.success, answer.status_message), (True, text))
        return answer

    def set_physics(self, **changes):
        known = self.physics
        request = SetPhysicsPropertiesRequest(known.time_step, known.max_update_rate, known.gravity, known.ode_config)
        for name, value in changes.items():
            setattr(request, name, value)
        return self.simulation.call("set_physics_properties", request)

    def spawn_puck(self, z=50.0, afloat=True):
        """Spawn a box of 2 kg, high above the ground, by default without gravity."""
        self.assertTrue(self.simulation.spawn("puck", data_text("puck.sdf"), (0.0, 0.0, z, 0.0), kind="sdf").success)
        if afloat:
            known = self.simulation.call("get_link_properties", "puck::body")
            self.call("set_link_properties", "SetLinkProperties: properties set", "puck::body", known.com, False,
                      known.mass, known.ixx, known.ixy, known.ixz, known.iyy, known.iyz, known.izz)
            self.call("set_link_state", "SetLinkState: success",
                      LinkState("puck::body", make_pose(z=z), Twist(), "world"))

    def speed(self):
        answer = self.simulation.call("get_link_state", "puck::body", "")
        self.assertEqual(answer.status_message, "GetLinkState: got state")
        return answer.link_state.twist.linear

    # ---- links -------------------------------------------------------------------------------------------------

    def test_a_wrench_lasts_its_duration_in_simulated_time(self):
        self.spawn_puck()
        self.call("apply_body_wrench", "", "puck::body", "", Point(), Wrench(Vector3(4.0, 0.0, 0.0), Vector3()),
                  rospy.Time(), rospy.Duration(0.5))
        self.simulation.run_for(0.7)
        self.assertAlmostEqual(self.speed().x, 1.0, delta=1e-6)     # 4 N for 0.5 s on 2 kg
        self.simulation.run_for(0.2)
        self.assertAlmostEqual(self.speed().x, 1.0, delta=1e-6)

    def test_a_wrench_requested_while_paused_starts_on_unpause(self):
        self.spawn_puck()
        self.simulation.call("pause_physics")
        self.call("apply_body_wrench", "", "puck::body", "puck::body", Point(),
                  Wrench(Vector3(0.0, 4.0, 0.0), Vector3()), rospy.Time(), rospy.Duration(0.25))
        self.assertEqual(self.speed().y, 0.0)
        self.simulation.call("unpause_physics")
        self.simulation.run_for(0.4)
        self.assertAlmostEqual(self.speed().y, 0.5, delta=1e-6)

    def test_an_endless_wrench_is_cleared(self):
        self.spawn_puck()
        self.call("apply_body_wrench", "", "puck::body", "", Point(), Wrench(Vector3(1.0, 0.0, 0.0), Vector3()),
                  rospy.Time(), rospy.Duration(-1))
        wait_until(lambda: self.speed().x > 0.05, "the box to move")
        self.simulation.call("clear_body_wrenches", "puck::body")
        reached = self.speed().x
        self.simulation.run_for(0.3)
        self.assertEqual(self.speed().x, reached)

    def test_a_link_is_set_by_the_topic_while_paused(self):
        self.spawn_puck()
        self.simulation.call("pause_physics")
        publisher = rospy.Publisher("/gazebo/set_link_state", LinkState, queue_size=1)
        wait_until(lambda: publisher.get_num_connections() > 0, "the simulation to listen")
        publisher.publish(LinkState("body", make_pose(1.0, 2.0, 3.0), Twist(Vector3(0.5, 0.0, 0.0), Vector3()), ""))
        wait_until(lambda: self.speed().x == 0.5, "the link to be set")
        state = self.simulation.call("get_link_state", "puck::body", "world").link_state
        self.assertEqual(xyz(state.pose.position), (1.0, 2.0, 3.0))
        publisher.unregister()

    def test_values_beyond_the_limits_are_refused_with_the_limit(self):
        self.spawn_puck(afloat=False)
        self.spawn_swing()
        now, forever = rospy.Time(), rospy.Duration(-1)
        known = self.simulation.call("get_physics_properties").gravity
        for answer in (
                self.simulation.call("apply_body_wrench", "puck::body", "", Point(),
                                     Wrench(Vector3(1e300, 0.0, 0.0), Vector3()), now, forever),
                self.simulation.call("set_joint_properties", "hinge", ODEJointProperties(fmax=[1e300], vel=[1e300])),
                self.set_physics(gravity=Vector3(0.0, 0.0, -1e300))):
            self.assertIs(answer.success, False)
            self.assertIn("expected at most", answer.status_message)
        self.simulation.run_for(0.2)
        self.assertEqual(self.simulation.call("get_physics_properties").gravity, known)

    # ---- joints ------------------------------------------------------------------------------------------------

    def spawn_swing(self):
        spawned = self.simulation.spawn("swing", data_text("swing.sdf"), (0.0, 0.0, 0.0, 0.0), kind="sdf")
        self.assertTrue(spawned.success)

    def joint(self):
        answer = self.call("get_joint_properties", "GetJointProperties: got properties", "swing::hinge")
        return answer.position[0], answer.rate[0]

    def test_an_effort_turns_a_joint_within_its_limit(self):
        self.spawn_swing()
        self.call("apply_joint_effort", "ApplyJointEffort: effort set", "hinge", 50.0, rospy.Time(),
                  rospy.Duration(0.5))
        self.simulation.run_for(0.6)
        self.assertAlmostEqual(self.joint()[1], 2.0, delta=0.01)    # 2 N m, the limit, for 0.5 s on 0.5 kg m^2

    def test_efforts_are_cleared_and_end_with_the_model(self):
        self.spawn_swing()
        for _ in range(2):
            self.call("apply_joint_effort", "ApplyJointEffort: effort set", "hinge", 0.5, rospy.Time(),
                      rospy.Duration(-1))
            wait_until(lambda: self.joint()[1] > 0.05, "the arm to turn")
            self.simulation.call("clear_joint_forces", "hinge")
            reached = self.joint()[1]
            self.simulation.run_for(0.2)
            self.assertAlmostEqual(self.joint()[1], reached, delta=1e-5)
            self.call("delete_model", "DeleteModel: successfully deleted model", "swing")
            self.spawn_swing()
            self.simulation.run_for(0.1)
            self.assertEqual(self.joint()[1], 0.0)

    def test_stops_and_motor_of_a_joint(self):
        self.spawn_swing()
        self.call("set_joint_properties", "SetJointProperties: properties set", "hinge",
                  ODEJointProperties(hiStop=[0.5], loStop=[-0.5], fmax=[10.0], vel=[2.0]))
        wait_until(lambda: self.joint()[0] > 0.45, "the arm to reach its stop")
        self.simulation.run_for(0.5)
        self.assertAlmostEqual(self.joint()[0], 0.5, delta=0.02)

    # ---- physics -----------------------------------------------------------------------------------------------

    def test_gravity_is_changed_and_read_back(self):
        self.spawn_puck(afloat=False)
        answer = self.set_physics(gravity=Vector3(1.0, 0.0, 0.0))
        self.assertEqual((answer.success, answer.status_message), (True, "physics engine updated"))
        self.assertEqual(xyz(self.simulation.call("get_physics_properties").gravity), (1.0, 0.0, 0.0))
        before = self.speed()
        wait_until(lambda: self.speed().x > before.x + 0.3, "the box to fall sideways")
        self.assertAlmostEqual(self.speed().z, before.z, delta=1e-6)

    def test_dynamic_parameters_are_read_and_written(self):
        client = Client("/gazebo", timeout=30.0)
        self.addCleanup(client.close)
        config = client.get_configuration(timeout=30.0)
        self.assertEqual((config["time_step"], config["gravity_z"], config["sor_pgs_iters"]), (0.001, -9.8, 50))
        self.assertEqual(rospy.get_param("/gazebo/gravity_z"), -9.8)
        changed = client.update_configuration({"gravity_z": -1.5, "max_contacts": 7})
        self.assertEqual((changed["gravity_z"], changed["max_contacts"]), (-1.5, 7))
        told = self.simulation.call("get_physics_properties")
        self.assertEqual((told.gravity.z, told.ode_config.max_contacts, told.time_step), (-1.5, 7, 0.001))
        refused = client.update_configuration({"time_step": 5.0})
        self.assertEqual(refused["time_step"], 0.001)       # within Gazebo's range, but not accepted by the engine
        self.set_physics()
        wait_until(lambda: client.get_configuration(timeout=30.0)["gravity_z"] == -9.8, "the change of the service")
        self.assertEqual(rospy.get_param("/gazebo/gravity_z"), -9.8)

    def test_the_pace_is_the_rate_times_the_step(self):
        self.assertTrue(self.set_physics(max_update_rate=0.0).success)
        begun = self.simulation.time()
        wait_until(lambda: self.simulation.time() > begun + 20.0, "twenty simulated seconds, as fast as it can")
        self.assertTrue(self.set_physics(time_step=0.005, max_update_rate=200.0).success)
        self.assertEqual(self.simulation.call("get_physics_properties").time_step, 0.005)
        self.simulation.run_for(0.2)

    # ---- lights, metrics ---------------------------------------------------------------------------------------

    def test_a_light_is_deleted_and_another_added(self):
        self.assertEqual(self.simulation.call("get_light_properties", "sun").status_message, "")
        answer = self.simulation.call("delete_light", "sun")
        self.assertEqual((answer.success, answer.status_message), (True, "DeleteLight: sun successfully deleted"))
        answer = self.simulation.call("get_light_properties", "sun")
        self.assertEqual((answer.success, answer.status_message),
                         (False, "getLightProperties: Requested light sun not found!"))
        lamp = '<sdf version="1.6"><light name="x" type="point"><diffuse>0.5 0.25 0 1</diffuse></light></sdf>'
        answer = self.simulation.spawn("lamp", lamp, kind="sdf")
        self.assertEqual((answer.success, answer.status_message), (True, "SpawnModel: Successfully spawned entity"))
        self.assertEqual(self.simulation.call("get_light_properties", "lamp").diffuse.r, 0.5)
        self.assertEqual(self.simulation.spawn("lamp", lamp, kind="sdf").status_message,
                         "SpawnModel: Failure - entity already exists.")
        self.assertNotIn("lamp", self.simulation.models())
        self.assertTrue(self.simulation.call("delete_light", "lamp").success)

    def test_metrics_are_published_to_a_subscriber(self):
        self.assertTrue(self.simulation.spawn("m2wr", rospy.get_param("/robot_description")).success)
        scans = Recorder("/m2wr/laser/scan", LaserScan).connected()
        metrics = Recorder("/gazebo/performance_metrics", PerformanceMetrics).connected()
        self.addCleanup(scans.close)
        self.addCleanup(metrics.close)

        scans.next(2)
        messages = metrics.next(6)
        for before, message in zip(messages, messages[1:]):
            sensor, = message.sensors
            interval = (message.header.stamp - before.header.stamp).to_sec()
            self.assertGreater(message.real_time_factor, 0.0)
            self.assertAlmostEqual(sensor.sim_update_rate * interval, 20.0 * interval, delta=1.001)     # whole scans
            self.assertEqual(sensor.fps, -1.0)


if __name__ == "__main__":
    rospy.init_node("check_services", disable_rostime=True)
    run_checks("services", Services)
