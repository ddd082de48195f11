#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""amcl: names, latching, accuracy, requests, parameters and bad input, in a room whose true map is known."""
import math
import os
import sys
import threading
import unittest

import numpy as np
import rospy
from dynamic_reconfigure.msg import Config, DoubleParameter, StrParameter
from dynamic_reconfigure.srv import Reconfigure
from geometry_msgs.msg import PoseArray, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from nav_msgs.srv import GetMap, GetMapResponse, SetMap
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from mapping_robot import ROOM, Robot, plane_geometry  # noqa: E402
from sim_probe import PATIENCE, Recorder, Running, program, run_checks, wait_until  # noqa: E402

CELL = 0.05
CORNER = (-4.5, -3.5)       # of the map [m]
SIZE = (180, 140)           # columns, rows
#: Poses of a drive through the room: forward, turn, forward.
TOUR = [(0.1 * k, 0.0, 0.0) for k in range(12)] + [(1.1, 0.0, -0.1 * k) for k in range(1, 16)]
QUICK = ["_update_min_d:=0.1", "_update_min_a:=0.1", "_max_particles:=1500", "_laser_max_beams:=60",
         "_odom_model_type:=diff-corrected"] + ["_odom_alpha%d:=0.01" % k for k in range(1, 6)]


def room_map(frame="map"):
    """The OccupancyGrid of ROOM."""
    x, y = (CORNER[0] + CELL * (np.arange(SIZE[0]) + 0.5), CORNER[1] + CELL * (np.arange(SIZE[1]) + 0.5))
    points = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    solid = np.zeros(len(points), bool)
    for rectangle in ROOM:
        local = np.abs(plane_geometry.into_frame(points, rectangle.x, rectangle.y, rectangle.yaw))
        solid |= (local[:, 0] <= rectangle.length / 2.0) & (local[:, 1] <= rectangle.width / 2.0)
    outside = (np.abs(points) > (4.2, 3.2)).any(axis=1)
    message = OccupancyGrid(data=np.where(solid, 100, np.where(outside, -1, 0)).astype(np.int8).tolist())
    message.header.frame_id = frame
    message.info.resolution, message.info.width, message.info.height = CELL, SIZE[0], SIZE[1]
    message.info.origin.position.x, message.info.origin.position.y = CORNER
    message.info.origin.orientation.w = 1.0
    return message


def moved(pose, by):
    """A pose composed with another."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.array([pose[0] + c * by[0] - s * by[1], pose[1] + s * by[0] + c * by[1], pose[2] + by[2]])


class Amcl(Running):
    """An amcl in a process of its own, synchronised with a :class:`Robot`."""

    def __init__(self, robot, words=()):
        self.robot = robot
        super().__init__([program("amcl", "amcl"), "_base_frame_id:=link_chassis"] + QUICK + list(words))
        self.poses, self.transforms = Recorder("/amcl_pose", PoseWithCovarianceStamped), Recorder("/tf", TFMessage)

    def __enter__(self):
        super().__enter__()
        self.wait_for_text("ready, listening to")
        robot = self.robot
        for publisher, count in ((robot.tf, 2), (robot.static, 1), (robot.scans, 1), (robot.clock, 1)):
            wait_until(lambda publisher=publisher, count=count: publisher.get_num_connections() >= count,
                       "%d subscribers to %s" % (count, publisher.resolved_name))
        self.poses.connected()
        self.transforms.connected(2)        # the robot's, and this node's
        robot.tell_time()
        self.wait_for_text("localizing on a map of")
        return self

    def __exit__(self, *arguments):
        if arguments[0] is not None:
            sys.stderr.write(self.text)
        self.poses.close()
        self.transforms.close()
        super().__exit__(*arguments)
        wait_until(lambda: self.robot.scans.get_num_connections() == 0, "the end of amcl")

    def correction(self, stamp, tolerance=0.1):
        """The transform map -> odom (x, y, yaw) that follows the scan of a stamp."""
        def found(messages):
            for message in messages:
                for entry in message.transforms:
                    if entry.header.frame_id == "map" \
                            and abs((entry.header.stamp - stamp).to_sec() - tolerance) < 1e-6:
                        turn = entry.transform.rotation
                        return (entry.transform.translation.x, entry.transform.translation.y,
                                2.0 * math.atan2(turn.z, turn.w))
            return None
        return self.transforms.wait(found, "map -> odom for the scan at %.3f" % stamp.to_sec())

    def drive(self, poses, odometry=(0.0, 0.0, 0.0)):
        """Drive along true poses; returns the errors (K, 3) of the pose by tf. ``odometry``: true pose of odom."""
        errors, back = [], odometry
        for pose in poses:
            robot = self.robot
            robot.tell_time(robot.now + 0.1)
            c, s = math.cos(back[2]), math.sin(back[2])
            dx, dy = pose[0] - back[0], pose[1] - back[1]
            in_odom = (c * dx + s * dy, c * dy - s * dx, pose[2] - back[2])
            robot.stand(in_odom)
            stamp = robot.look(pose).header.stamp
            error = moved(self.correction(stamp), in_odom) - pose
            errors.append((error[0], error[1], math.remainder(error[2], 2.0 * math.pi)))
        return np.array(errors)


class CheckAmcl(unittest.TestCase):
    """Every test starts a node of its own; time continues from one to the next."""

    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()
        cls.map, cls.asked = room_map(), threading.Event()
        cls.service = cls.serve()

    @classmethod
    def serve(cls):
        def answer(_):
            cls.asked.set()
            return GetMapResponse(cls.map)
        return rospy.Service("/static_map", GetMap, answer)

    def setUp(self):
        self.robot.now += 100.0             # separates the tests
        if rospy.has_param("/amcl"):
            rospy.delete_param("/amcl")
        self.robot.mount()

    def assert_accurate(self, errors):
        self.assertLess(np.hypot(errors[:, 0], errors[:, 1]).max(), 0.05, errors)
        self.assertLess(np.abs(errors[:, 2]).max(), math.radians(2.0), errors)

    def test_a_wrong_start_and_odometry_are_corrected(self):
        with Amcl(self.robot, ["_initial_pose_x:=0.2", "_initial_pose_y:=-0.15", "_initial_pose_a:=0.1"]) as node:
            errors = node.drive(TOUR, odometry=(5.0, -3.0, 2.0))
            self.assert_accurate(errors[8:])
            pose = node.poses.wait(lambda messages: messages[-1], "a pose")
            self.assertEqual(pose.header.frame_id, "map")
            covariance = np.array(pose.pose.covariance).reshape(6, 6)
            self.assertGreater(np.diag(covariance)[[0, 1, 5]].min(), 0.0)
            self.assertFalse(covariance[2:5].any() or covariance[:, 2:5].any())
            cloud = Recorder("/particlecloud", PoseArray)        # latched: it comes to a late subscriber
            particles = cloud.wait(lambda messages: messages[-1].poses, "the particles")
            cloud.close()
            self.assertGreaterEqual(len(particles), 100)
            self.assertLess(np.std([particle.position.x for particle in particles]), 0.3)

    def test_global_localization_finds_the_robot(self):
        with Amcl(self.robot, ["_initial_pose_x:=-3.0", "_initial_pose_y:=2.0", "_initial_pose_a:=3.0"]) as node:
            rospy.wait_for_service("/global_localization", PATIENCE)
            rospy.ServiceProxy("/global_localization", Empty)()
            self.assert_accurate(node.drive(TOUR)[-5:])

    def test_an_initial_pose_is_taken_or_refused_with_reason(self):
        sender = rospy.Publisher("/initialpose", PoseWithCovarianceStamped, queue_size=5)
        with Amcl(self.robot, ["_initial_pose_x:=-3.0"]) as node:
            wait_until(lambda: sender.get_num_connections() > 0, "a subscriber to initialpose")
            message = PoseWithCovarianceStamped()
            message.pose.pose.orientation.w = 1.0
            message.header.frame_id = "elsewhere"
            sender.publish(message)
            node.wait_for_text("its frame is 'elsewhere'")
            message.header.frame_id = "map"
            message.pose.pose.position.x = math.nan
            sender.publish(message)
            node.wait_for_text("its position is (nan, 0.0)")
            message.pose.pose.position.x = 0.1
            message.pose.covariance[0] = -1.0
            sender.publish(message)
            node.wait_for_text("its covariance of x, y, yaw")
            message.pose.covariance = [0.0] * 36
            for place, value in ((0, 0.05), (7, 0.05), (35, 0.02)):
                message.pose.covariance[place] = value
            sender.publish(message)
            node.wait_for_text("initial pose: (0.100, 0.000)")
            self.assert_accurate(node.drive(TOUR)[8:])

    def test_an_update_without_motion_weighs_the_particles(self):
        with Amcl(self.robot) as node:
            node.drive([(0.0, 0.0, 0.0)] * 3)
            clouds = Recorder("/particlecloud", PoseArray).connected()
            clouds.wait(lambda messages: messages, "the latched particles")
            clouds.clear()
            node.drive([(0.0, 0.0, 0.0)] * 3)
            self.assertEqual(len(clouds.messages), 0, "an update without motion or request")
            rospy.ServiceProxy("/request_nomotion_update", Empty)()
            node.drive([(0.0, 0.0, 0.0)])
            clouds.wait(lambda messages: messages, "particles after the request")
            clouds.close()

    def test_set_map_replaces_map_and_pose_or_says_why_not(self):
        with Amcl(self.robot, ["_initial_pose_x:=-3.0"]) as node:
            rospy.wait_for_service("/set_map", PATIENCE)
            set_map = rospy.ServiceProxy("/set_map", SetMap)
            pose = PoseWithCovarianceStamped()
            pose.pose.pose.orientation.w = 1.0
            for place, value in ((0, 0.05), (7, 0.05), (35, 0.02)):
                pose.pose.covariance[place] = value
            wrong = room_map()
            wrong.data = wrong.data[:-1]
            self.assertFalse(set_map(wrong, pose).success)
            node.wait_for_text("set_map is refused: it is 180 x 140 cells with 25199 values")
            self.assertTrue(set_map(self.map, pose).success)
            self.assert_accurate(node.drive(TOUR)[8:])

    def test_the_pose_is_stored_for_the_next_start(self):
        with Amcl(self.robot, ["_save_pose_rate:=10"]) as node:
            node.drive(TOUR)
            true = TOUR[-1]
            wait_until(lambda: abs(rospy.get_param("/amcl/initial_pose_a", 9.0) - true[2]) < 0.05
                       and abs(rospy.get_param("/amcl/initial_pose_x", 9.0) - true[0]) < 0.1
                       and rospy.get_param("/amcl/initial_cov_xx") < 0.05, "the pose as parameters")
        with Amcl(self.robot) as node:
            self.assert_accurate(node.drive([true] * 3))

    def test_parameters_are_named_clipped_and_reconfigured(self):
        with Amcl(self.robot, ["_laser_max_beam:=20", "_min_particles:=many", "_odom_model_type:=odd",
                               "_update_min_d:=99"]) as node:
            node.wait_for_text("laser_max_beam has no effect; did you mean laser_max_beams?")
            node.wait_for_text("min_particles is 'many'; expected a whole number")
            node.wait_for_text("~odom_model_type is 'odd'; expected diff or omni")
            self.assertEqual(rospy.get_param("/amcl/update_min_d"), 5.0)
            self.assertEqual(rospy.get_param("/amcl/kld_err"), 0.01)
            change = rospy.ServiceProxy("/amcl/set_parameters", Reconfigure)
            change(Config(doubles=[DoubleParameter("update_min_d", 0.1)],
                          strs=[StrParameter("laser_model_type", "likelihood_field_prob")]))
            self.assert_accurate(node.drive(TOUR)[8:])

    def test_bad_scans_are_refused_and_the_node_continues(self):
        with Amcl(self.robot) as node:
            robot = self.robot
            robot.tell_time(robot.now + 0.1)
            robot.stand((0.0, 0.0, 0.0))
            robot.scan([])
            node.wait_for_text("it has no ranges")
            robot.tell_time(robot.now + 0.1)
            robot.stand((0.0, 0.0, 0.0))
            robot.scan([1.0, 2.0], increment=math.nan)
            node.wait_for_text("expected finite numbers")
            robot.tell_time(robot.now + 0.1)
            robot.stand((0.0, 0.0, 0.0))
            robot.scan([math.nan] * 181)
            self.assert_accurate(node.drive(TOUR)[8:])

    def test_an_upside_down_laser_and_the_beam_model_work(self):
        self.robot.mount((1.0, 0.0, 0.0, 0.0))
        with Amcl(self.robot, ["_laser_model_type:=beam", "_laser_max_beams:=40"]) as node:
            for pose in TOUR:
                self.robot.tell_time(self.robot.now + 0.1)
                self.robot.stand(pose)
                stamp = self.robot.look(pose, upside_down=True).header.stamp
                error = moved(node.correction(stamp), pose) - pose
            self.assertLess(math.hypot(error[0], error[1]), 0.05)
            self.assertLess(abs(error[2]), math.radians(2.0))

    def test_without_a_map_it_says_what_is_missing_and_waits(self):
        self.service.shutdown()
        try:
            words = [program("amcl", "amcl"), "_base_frame_id:=link_chassis"]
            with Running(words) as node:
                node.wait_for_text("waiting for the map of the service /static_map")
                type(self).service = self.serve()
                node.wait_for_text("localizing on a map of 180 x 140 cells")
        finally:
            if not rospy.get_param("/amcl", None):
                type(self).service = self.service

    def test_a_map_of_the_topic_is_used(self):
        maps = rospy.Publisher("/map", OccupancyGrid, queue_size=1, latch=True)
        maps.publish(self.map)
        try:
            with Amcl(self.robot, ["_use_map_topic:=true"]) as node:
                self.assert_accurate(node.drive(TOUR)[8:])
        finally:
            maps.unregister()

    def test_after_a_jump_back_in_time_it_starts_again(self):
        with Amcl(self.robot) as node:
            node.drive(TOUR)
            self.robot.now -= 50.0
            self.robot.mount()

            def told():
                self.robot.tick(TOUR[0])
                return "taken to be at its initial pose again" in node.text
            wait_until(told, "the message about the jump")
            self.assert_accurate(node.drive(TOUR)[8:])


if __name__ == "__main__":
    rospy.init_node("check_amcl")
    run_checks("check_amcl", CheckAmcl)
