#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""/m2wr/laser/scan: fields, stamps, distances in a known room, no messages without a subscriber, and its frame."""
import math
import os
import sys
import unittest

import rosgraph
import rospy
import tf2_ros
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, make_pose, run_checks, seconds_of, wait_until, xyz  # noqa: E402

TOPIC = "/m2wr/laser/scan"
BEAMS, HALF, NEAREST, FARTHEST = 720, 1.570796, 0.1, 10.0
SIGMA = 0.01                    # m, of the description
PERIOD_NS, STEP_NS = 50000000, 1000000
SENSOR = (0.15, 0.0)            # in the robot's frame
WALLS = (                       # the faces of laser_room.world that can be seen, as end points
    ((3.0, -2.0), (3.0, 2.0)), ((-2.0, 2.0), (2.0, 2.0)), ((2.0, 2.0), (2.0, 2.1)),
    ((3.0, 2.0), (3.1, 2.0)), ((3.0, -2.0), (3.1, -2.0)))
POST = ((1.5, -1.5), 0.25)
SCANS = 40
TOLERANCE = 6.0 * SIGMA / math.sqrt(SCANS) + 1e-3      # m, of a mean over SCANS; 1 mm for the pose of the robot


def to_wall(angle, wall):
    """Distance from the sensor along ``angle`` to a segment, inf where the ray misses it."""
    (ax, ay), (bx, by) = ((x - SENSOR[0], y - SENSOR[1]) for x, y in wall)
    cosine, sine = math.cos(angle), math.sin(angle)
    across = cosine * (by - ay) - sine * (bx - ax)
    if abs(across) < 1e-12:
        return math.inf
    distance = (ax * (by - ay) - ay * (bx - ax)) / across
    along = (ax * sine - ay * cosine) / across
    return distance if distance > 0.0 and 0.0 <= along <= 1.0 else math.inf


def to_post(angle, post):
    """Distance from the sensor along ``angle`` to a circle, inf where the ray misses it."""
    x, y, radius = post[0][0] - SENSOR[0], post[0][1] - SENSOR[1], post[1]
    ahead = x * math.cos(angle) + y * math.sin(angle)
    beside = x * math.sin(angle) - y * math.cos(angle)
    return ahead - math.sqrt(radius ** 2 - beside ** 2) if ahead > 0.0 and abs(beside) < radius else math.inf


def expected_ranges():
    """The noiseless scan of a robot at the origin."""
    ranges = []
    for beam in range(BEAMS):
        angle = -HALF + beam * 2.0 * HALF / (BEAMS - 1)
        nearest = min([to_wall(angle, wall) for wall in WALLS] + [to_post(angle, POST)])
        ranges.append(nearest if nearest < FARTHEST else math.inf)
    return ranges


class Laser(unittest.TestCase):
    """The robot stands at the origin and faces along x."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.simulation.run_for(1.0)     # the robot has settled

    def test_fields(self):
        recorder = Recorder(TOPIC, LaserScan).connected()
        scan = recorder.next()[0]
        recorder.close()
        self.assertEqual(scan.header.frame_id, "sensor_laser")
        self.assertEqual(len(scan.ranges), BEAMS)
        self.assertEqual(list(scan.intensities), [0.0] * BEAMS)
        for found, wanted in ((scan.angle_min, -HALF), (scan.angle_max, HALF), (scan.range_min, NEAREST),
                              (scan.range_max, FARTHEST), (scan.angle_increment, 2.0 * HALF / (BEAMS - 1))):
            self.assertAlmostEqual(found, wanted, delta=1e-6)       # the message holds single precision
        self.assertEqual((scan.time_increment, scan.scan_time), (0.0, 0.0))

    def test_stamps_are_a_twentieth_of_a_second_apart(self):
        recorder = Recorder(TOPIC, LaserScan).connected()
        stamps = [scan.header.stamp.to_nsec() for scan in recorder.next(SCANS)]
        recorder.close()
        gaps = [b - a for a, b in zip(stamps, stamps[1:])]
        for gap in gaps:
            self.assertGreater(gap, 0)
            self.assertEqual(gap % PERIOD_NS, 0)
        lost = sum(gap // PERIOD_NS - 1 for gap in gaps)
        self.assertLessEqual(lost, SCANS // 10, "%d scans are missing" % lost)

    def test_distances_are_those_of_the_room(self):
        recorder = Recorder(TOPIC, LaserScan).connected()
        scans = [scan.ranges for scan in recorder.next(SCANS)]
        recorder.close()
        expected = expected_ranges()
        self.assertGreater(sum(math.isinf(value) for value in expected), 100)
        residuals, compared = [], 0
        for beam in range(BEAMS):
            # where the neighbours hit another surface, a tiny angle decides what this beam hits
            around = expected[max(0, beam - 2):beam + 3]
            if math.isinf(expected[beam]):
                if all(math.isinf(value) for value in around):
                    self.assertEqual({scan[beam] for scan in scans}, {math.inf}, "beam %d" % beam)
                continue
            if max(around) - min(around) > 0.15:
                continue
            compared += 1
            values = [scan[beam] for scan in scans]
            self.assertTrue(all(NEAREST <= value <= FARTHEST for value in values), "beam %d" % beam)
            residuals += [value - expected[beam] for value in values]
            mean = sum(values) / len(values)
            self.assertAlmostEqual(mean, expected[beam], delta=TOLERANCE, msg="beam %d" % beam)
        self.assertGreater(compared, 400)
        spread = math.sqrt(sum(value ** 2 for value in residuals) / len(residuals))
        self.assertAlmostEqual(spread, SIGMA, delta=0.05 * SIGMA)
        self.assertLess(abs(sum(residuals) / len(residuals)), 1e-3)

    def test_the_first_subscriber_gets_a_scan_with_the_next_step(self):
        published = dict(rosgraph.Master(rospy.get_name()).getSystemState()[0])
        self.assertEqual(published[TOPIC], ["/gazebo"])
        recorder = Recorder(TOPIC, LaserScan).connected()
        old = recorder.next()[0].header.stamp.to_nsec()
        recorder.close()
        self.simulation.run_for(0.2)        # the sensor stops measuring
        now = wait_until(lambda: self.paused_off_the_grid(old), "a time at which no scan is due")
        recorder = Recorder(TOPIC, LaserScan).connected()
        self.simulation.call("unpause_physics")
        first = recorder.wait(lambda messages: messages[0], "the first scan").header.stamp.to_nsec()
        recorder.close()
        self.assertEqual(first - now, STEP_NS, "the first scan comes with the first step, 1 ms")

    def paused_off_the_grid(self, old):
        """Pause at a time that does not precede a regular stamp of the old sequence; returns the time [ns], or None."""
        self.simulation.call("pause_physics")
        now = int(round(self.simulation.time() * 1e9))
        if (now + STEP_NS - old) % PERIOD_NS:
            return now
        self.simulation.call("unpause_physics")
        return None

    def test_a_model_is_seen_until_it_is_deleted(self):
        recorder = Recorder(TOPIC, LaserScan).connected()
        middle = slice(BEAMS // 2 - 20, BEAMS // 2 + 20)
        self.assertAlmostEqual(min(recorder.next()[0].ranges[middle]), 2.85, delta=0.06)
        answer = self.simulation.call("spawn_sdf_model", "box", BOX, "", make_pose(1.5, 0.0, 0.5), "")
        self.assertTrue(answer.success, answer.status_message)
        recorder.wait(lambda messages: abs(min(messages[-1].ranges[middle]) - 1.1) < 0.06, "a box 1.1 m ahead")
        self.simulation.call("delete_model", "box")
        recorder.wait(lambda messages: abs(min(messages[-1].ranges[middle]) - 2.85) < 0.06, "the wall again")
        recorder.close()

    def test_all_frames_are_connected(self):
        tree = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(tree)
        scans, odometry = Recorder(TOPIC, LaserScan), Recorder("/odom", Odometry)
        for frame, place in (("sensor_laser", (0.15, 0.0, 0.15)), ("link_right_wheel", (-0.05, 0.2, 0.1)),
                             ("link_left_wheel", (-0.05, -0.2, 0.1)), ("link_chassis", (0.0, 0.0, 0.1))):
            found = tree.lookup_transform("odom", frame, rospy.Time(0), rospy.Duration(10))
            for have, want in zip(xyz(found.transform.translation), place):
                self.assertAlmostEqual(have, want, delta=0.002, msg=frame)
        for scan in scans.next(5):
            # odometry is sent every 50 ms, so a transform at the scan's stamp is available soon after
            self.assertTrue(tree.can_transform("odom", scan.header.frame_id, scan.header.stamp, rospy.Duration(5)))
        self.assertEqual(len(set(seconds_of(odometry.next(10)))), 10)
        listener.unregister()
        scans.close()
        odometry.close()


BOX = """<sdf version="1.6"><model name="box"><static>true</static><link name="link"><collision name="side"><geometry>
<box><size>0.5 0.5 1</size></box></geometry></collision></link></model></sdf>"""

if __name__ == "__main__":
    rospy.init_node("check_laser")      # with simulated time, which tf needs
    run_checks("laser", Laser)
