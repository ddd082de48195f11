# SPDX-License-Identifier: BSD-3-Clause
"""A bag of a short drive, and the replay command on it."""
import json
import math

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from conftest import drive, odometry
from m2wr_gmapping.replay import replay_command as command

MOUNT = 0.2
SETTINGS = ["_particles:=5", "_linearUpdate:=0.5", "_xmin:=-5", "_xmax:=5", "_ymin:=-5", "_ymax:=5", "_threads:=1",
            "_base_frame:=base", "--quiet"]


def transform(parent, child, stamp, pose):
    message = TransformStamped()
    message.header.frame_id, message.header.stamp, message.child_frame_id = parent, stamp, child
    message.transform.translation.x, message.transform.translation.y = pose[0], pose[1]
    message.transform.rotation.z, message.transform.rotation.w = math.sin(pose[2] / 2), math.cos(pose[2] / 2)
    return message


def write_bag(path, ring, laser, late=0, static=True, tf=True, compression="none", beams=None):
    """A short drive; transforms come ``late`` records after their scans; ``beams``: ranges of every third scan."""
    truth = drive(0.25)
    odom = odometry(truth, np.random.default_rng(1), 0.01, 0.0)
    waiting = []
    with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=20000) as bag:
        start = rospy.Time(100)
        if static and tf:
            bag.write("/tf_static", TFMessage([transform("base", "laser", start, (MOUNT, 0.0, 0.0))]), start)
        for k, (pose, at) in enumerate(zip(truth, odom)):
            stamp = rospy.Time(100 + k // 10, k % 10 * 100000000)
            scan = LaserScan()
            scan.header.frame_id, scan.header.stamp = "laser", stamp
            scan.angle_min, scan.angle_max, scan.angle_increment = laser.angles[0], laser.angles[-1], math.pi / 180
            scan.range_min, scan.range_max = 0.05, 20.0
            seen = [pose[0] + MOUNT * math.cos(pose[2]), pose[1] + MOUNT * math.sin(pose[2]), pose[2]]
            scan.ranges = ring.ranges(seen, laser.angles).tolist()
            if beams is not None and k % 3 == 1:
                scan.ranges = scan.ranges[:beams]
            bag.write("/scan", scan, stamp)
            transforms = [transform("odom", "base", stamp, at)]
            if not static:
                transforms.append(transform("base", "laser", stamp, (MOUNT, 0.0, 0.0)))
            waiting.append((TFMessage(transforms), stamp))
            if tf and len(waiting) > late:
                bag.write("/tf", waiting[0][0], stamp)
                waiting.pop(0)
        for message, stamp in waiting if tf else []:
            bag.write("/tf", message, stamp + rospy.Duration(1))
    return truth


def run(tmp_path, *more):
    stats = tmp_path / "stats.json"
    code = command.main(["--bag_filename", str(tmp_path / "drive.bag"), "--stats", str(stats)] + SETTINGS + list(more))
    return code, json.loads(stats.read_text()) if stats.exists() else None


def table(path):
    return np.loadtxt(str(path), ndmin=2)
