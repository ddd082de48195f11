# SPDX-License-Identifier: BSD-3-Clause
"""The environment of a mapping node: time, transforms and scans, from a bag or from plane geometry."""
import math
import os
import sys

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "scripts"))
import plane_geometry  # noqa: E402
from sim_probe import Recorder, Running, data_path, program, wait_until, yaw_of  # noqa: E402

#: The laser of m2wr in the frame link_chassis [m].
LASER_X = plane_geometry.LASER_X
#: A room of 8 x 6 m with two boxes in it, for scans made here: no symmetry, so every pose has a distinct scan.
ROOM = [plane_geometry.Rectangle(*row) for row in (
    (0.0, 3.1, 0.0, 8.4, 0.2), (0.0, -3.1, 0.0, 8.4, 0.2), (4.1, 0.0, 0.0, 0.2, 6.4), (-4.1, 0.0, 0.0, 0.2, 6.4),
    (2.0, 1.5, 0.4, 1.0, 0.6), (-2.2, -1.2, -0.3, 0.8, 1.2))]


def transform(parent, child, stamp, x=0.0, y=0.0, z=0.0, quaternion=(0.0, 0.0, 0.0, 1.0)):
    """Return a TransformStamped."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    place, turn = message.transform.translation, message.transform.rotation
    place.x, place.y, place.z = x, y, z
    turn.x, turn.y, turn.z, turn.w = quaternion
    return message


def about_z(angle):
    """Return the quaternion x, y, z, w of a rotation about z."""
    return (0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle))


def whole_bag(name, path):
    """Write a bag of test/data, preceded by the transform of the laser's mount, which it lacks."""
    with rosbag.Bag(data_path(name + ".bag")) as bag, rosbag.Bag(path, "w") as made:
        for index, (topic, message, stamp) in enumerate(bag.read_messages()):
            if not index:
                made.write("/tf_static", TFMessage([transform("link_chassis", "sensor_laser", stamp, LASER_X)]), stamp)
            made.write(topic, message, stamp)


class Robot:
    """Publishes /clock, /tf, /tf_static and scans; :attr:`now` is the time [s], :attr:`prefix` stands before frames."""

    def __init__(self, scan_topic="/scan", start=10.0):
        self.now, self.prefix = start, ""
        self.clock = rospy.Publisher("/clock", Clock, queue_size=100)
        self.tf = rospy.Publisher("/tf", TFMessage, queue_size=1000)
        self.static = rospy.Publisher("/tf_static", TFMessage, queue_size=10, latch=True)
        self.scans = rospy.Publisher(scan_topic, LaserScan, queue_size=1000)

    def tell_time(self, now=None):
        """Publish the time; set it first if one is given."""
        self.now = self.now if now is None else now
        self.clock.publish(Clock(rospy.Time.from_sec(self.now)))

    def mount(self, quaternion=(0.0, 0.0, 0.0, 1.0), x=LASER_X, y=0.0, frame="sensor_laser"):
        """Publish the transform from link_chassis to the laser."""
        self.static.publish(TFMessage([transform(self.prefix + "link_chassis", self.prefix + frame, rospy.Time(0),
                                                 x, y, 0.05, quaternion)]))

    def stand(self, pose, stamp=None):
        """Publish the odometry's transform for a pose (x, y, yaw) of link_chassis."""
        stamp = rospy.Time.from_sec(self.now) if stamp is None else stamp
        self.tf.publish(TFMessage([transform(self.prefix + "odom", self.prefix + "link_chassis", stamp,
                                             pose[0], pose[1], 0.0, about_z(pose[2]))]))

    def scan(self, ranges, angle_min=-math.pi / 2, increment=math.pi / 180, frame="sensor_laser", range_max=10.0):
        """Publish a scan taken now; returns it."""
        message = LaserScan(angle_min=angle_min, angle_max=angle_min + increment * (len(ranges) - 1),
                            angle_increment=increment, range_min=0.1, range_max=range_max,
                            ranges=np.asarray(ranges, float).tolist())
        message.header.frame_id, message.header.stamp = self.prefix + frame, rospy.Time.from_sec(self.now)
        self.scans.publish(message)
        return message

    def look(self, pose, count=181, angle_min=-math.pi / 2, increment=math.pi / 180, upside_down=False,
             mount=(LASER_X, 0.0, 0.0)):
        """Publish what a laser sees in :data:`ROOM`; the robot stands at ``pose``, the laser at ``mount`` on it."""
        origin = (pose[0] + math.cos(pose[2]) * mount[0] - math.sin(pose[2]) * mount[1],
                  pose[1] + math.sin(pose[2]) * mount[0] + math.cos(pose[2]) * mount[1])
        angles = angle_min + increment * np.arange(count)
        directions = pose[2] + mount[2] + (-angles if upside_down else angles)
        return self.scan(plane_geometry.ray_distances(origin, directions, ROOM), angle_min, increment)

    def tick(self, pose, seconds=0.1, **laser):
        """Advance time, then publish the transform and the scan of a pose; returns the scan."""
        self.tell_time(self.now + seconds)
        self.stand(pose)
        return self.look(pose, **laser)


class Mapping(Running):
    """A mapping node in a process of its own, synchronised with a :class:`Robot`.

    Parameters
    ----------
    robot : Robot
    words : sequence of str
        Command line, for instance ``_particles:=10``.
    package, name : str
        The executable.
    """

    def __init__(self, robot, words=(), package="m2wr_gmapping", name="slam_gmapping"):
        self.robot = robot
        super().__init__([program(package, name), "_base_frame:=link_chassis"] + list(words))
        self.poses = Recorder("/slam_gmapping/pose", PoseWithCovarianceStamped)

    def __enter__(self):
        super().__enter__()
        self.wait_for_text("ready, listening to")
        robot = self.robot
        for publisher, topic in ((robot.tf, "tf"), (robot.static, "tf_static"), (robot.scans, "scans"),
                                 (robot.clock, "the clock")):
            wait_until(lambda publisher=publisher: publisher.get_num_connections() > 0, "a subscriber to %s" % topic)
        self.poses.connected()
        robot.tell_time()
        return self

    def __exit__(self, *arguments):
        self.poses.close()
        super().__exit__(*arguments)
        wait_until(lambda: self.robot.scans.get_num_connections() == 0, "the end of the mapping node")

    def wait_for_pose(self, stamp):
        """Wait until the scan of a stamp has been taken; returns its pose message."""
        def found(messages):
            matching = [message for message in messages if message.header.stamp == stamp]
            return matching[-1] if matching else None
        return self.poses.wait(found, "the pose for the scan at %.3f" % stamp.to_sec())

    def drive(self, poses, **laser):
        """Publish the robot's scan at each pose; returns the last pose message."""
        answer = None
        for pose in poses:
            answer = self.wait_for_pose(self.robot.tick(pose, **laser).header.stamp)
        return answer

    def play(self, name):
        """Play a bag of test/data, waiting for the node; returns the stamps [s] of the scans that were answered."""
        robot, waiting, answered = self.robot, None, []
        with rosbag.Bag(data_path(name + ".bag")) as bag:
            messages = list(bag.read_messages(["/tf", "/m2wr/laser/scan"]))
        begin = robot.now + 1.0
        shift = rospy.Duration.from_sec(begin - messages[0][2].to_sec())
        first_transform = min(m.transforms[0].header.stamp for topic, m, _ in messages if topic == "/tf") + shift
        for topic, message, stamp in messages:
            if topic == "/tf":
                for entry in message.transforms:
                    entry.header.stamp += shift
                robot.tell_time((stamp + shift).to_sec())
                robot.tf.publish(message)
                continue
            if waiting is not None:
                answered.append(self.wait_for_pose(waiting).header.stamp.to_sec())
            message.header.stamp += shift
            robot.tell_time((stamp + shift).to_sec())
            robot.scans.publish(message)
            waiting = message.header.stamp if message.header.stamp >= first_transform else None
        if waiting is not None:
            answered.append(self.wait_for_pose(waiting).header.stamp.to_sec())
        return answered


def xyt(message):
    """Return x, y, yaw of a message with a pose."""
    pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
    return np.array([pose.position.x, pose.position.y, yaw_of(pose.orientation)])


def walls_apart(grid, rectangles):
    """Return the distances (N,) [m] of the occupied cells of a map to the nearest side of the rectangles."""
    info = grid.info
    rows, columns = np.nonzero(np.asarray(grid.data, np.int8).reshape(info.height, info.width) == 100)
    points = np.stack((columns, rows), -1) * info.resolution + (info.origin.position.x, info.origin.position.y)
    nearest = np.full(len(points), math.inf)
    for rectangle in rectangles:
        local = np.abs(plane_geometry.into_frame(points, rectangle.x, rectangle.y, rectangle.yaw))
        out = local - np.array((rectangle.length, rectangle.width)) / 2.0
        apart = np.hypot(*np.maximum(out, 0.0).T) + np.minimum(out.max(axis=1), 0.0)
        nearest = np.minimum(nearest, np.abs(apart))
    return nearest
